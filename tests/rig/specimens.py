"""Families of base muscles: geometry, strands and moduli drawn so that the muscle is physically sensible."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

import numpy as np

from .muscle import Braid, Geometry, Law, Muscle, Simulation, free_contraction, static_force

Range = tuple[float, float]


@dataclass(frozen=True)
class Family:
    """Ranges of one kind of muscle: lengths in mm, wall as a share of R0, angle in deg, pressure in kPa."""

    name: str
    L0: Range
    R0: Range
    wall: Range
    alpha0: Range
    top_kPa: Range
    E_br_GPa: Range
    strand_share: Range  # strand radius as a share of R0
    strands: tuple[int, int]


FAMILIES: dict[str, Family] = {
    f.name: f
    for f in (
        Family(
            "pencil",
            (60, 95),
            (2.6, 3.8),
            (0.12, 0.24),
            (67, 72),
            (200, 350),
            (1.2, 2.6),
            (0.03, 0.05),
            (36, 64),
        ),
        Family(
            "thumb",
            (120, 180),
            (5.0, 8.0),
            (0.1, 0.2),
            (62, 67),
            (250, 500),
            (1.0, 3.0),
            (0.02, 0.03),
            (64, 120),
        ),
        Family(
            "stub",
            (45, 75),
            (4.0, 6.5),
            (0.12, 0.2),
            (66, 70),
            (120, 250),
            (0.6, 1.5),
            (0.02, 0.04),
            (48, 96),
        ),
        Family(
            "needle",
            (30, 55),
            (2.0, 2.7),
            (0.14, 0.26),
            (69, 74.5),
            (150, 300),
            (1.5, 3.0),
            (0.03, 0.06),
            (24, 48),
        ),
        Family(
            "arm",
            (190, 300),
            (8.0, 12.0),
            (0.08, 0.16),
            (60, 64.5),
            (300, 600),
            (1.5, 4.0),
            (0.015, 0.03),
            (80, 160),
        ),
        Family(
            "finger",
            (95, 150),
            (3.8, 5.2),
            (0.15, 0.25),
            (63, 69),
            (180, 420),
            (0.8, 2.2),
            (0.02, 0.04),
            (40, 90),
        ),
    )
}


def draw(rng: random.Random, span: Range) -> float:
    """Uniform in `span`, kept to four significant digits as a data sheet would."""
    return float(f"{rng.uniform(*span):.4g}")


def geometry_of(family: Family, rng: random.Random) -> tuple[Geometry, Braid, float]:
    """Geometry, strands and the highest pressure [kPa]."""
    R0 = draw(rng, family.R0)
    g = Geometry(
        draw(rng, family.L0),
        R0,
        float(f"{R0 * rng.uniform(*family.wall):.3g}"),
        round(rng.uniform(*family.alpha0), 1),
    )
    n = 2 * round(rng.uniform(*family.strands) / 2)
    b = Braid(draw(rng, family.E_br_GPa), 0.33, float(f"{R0 * rng.uniform(*family.strand_share):.3g}"), n)
    return g, b, float(round(rng.uniform(*family.top_kPa) / 10) * 10)


def whole_levels(shares: tuple[float, ...], top_kPa: float) -> tuple[float, ...]:
    """Levels in whole kPa from shares of the highest."""
    return tuple(float(round(top_kPa * share)) for share in shares)


def _scaled(law: Law, factor: float) -> Law:
    return replace(law, constants=tuple(tuple(factor * c for c in row) for row in law.constants))


def _softest_sensible(m: Muscle, top_kPa: float, target: float) -> float:
    """Factor on the moduli at which the free contraction at the highest level is `target` (bisection)."""
    low, high = 0.0, 1.0
    for _ in range(60):
        if free_contraction(m.with_simulation(law=_scaled(m.simulation.law, high)), top_kPa) < target:
            break
        high *= 2.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        scaled = m.with_simulation(law=_scaled(m.simulation.law, middle))
        low, high = (middle, high) if free_contraction(scaled, top_kPa) > target else (low, middle)
    return 0.5 * (low + high)


def tensile_muscle(
    family: Family,
    rng: random.Random,
    friction: str = "coulomb",
    kinematics: str = "inextensible_braid",
    order: int | None = None,
) -> tuple[Muscle, float]:
    """A muscle whose moduli come from a tensile test (constant law, engineering strain), and its top level.

    The moduli bring the free contraction at the top level to 0.62-0.88 of the wall-less one; the true ones
    differ from the declared by one common factor inside about 1.2 declared sd.
    """
    g, b, top = geometry_of(family, rng)
    M = order or rng.choice((1, 2, 2, 3))
    shares = [1.0, rng.uniform(0.1, 0.7), rng.uniform(0.02, 0.15)][:M]
    sd = rng.choice((0.05, 0.1, 0.15))
    error = 1.0 + sd * rng.uniform(-1.2, 1.2)
    value = rng.uniform(0.03, 0.09) if friction == "coulomb" else rng.uniform(0.2, 0.5)
    bare = Muscle(
        family.name,
        g,
        b,
        Simulation(
            kinematics,
            "engineering",
            friction,
            (float(f"{value:.4g}"),),
            law=Law("constant", ((0.0,),)),
            E_rel_sd=sd,
        ),
    )
    target = min(0.34, rng.uniform(0.62, 0.88) * free_contraction(bare, top))
    unit = bare.with_simulation(law=Law("constant", tuple((1e5 * s,) for s in shares)))
    factor = _softest_sensible(unit, top, target)
    declared = tuple(float(f"{1e5 * factor * s:.4g}") for s in shares)
    law = Law("constant", tuple((e * error,) for e in declared))
    return unit.with_simulation(law=law, declared_E_Pa=declared), top


def loops_muscle(
    family: Family,
    rng: random.Random,
    law: str = "linear",
    order: int = 3,
    friction: str = "coulomb",
    strain: str = "engineering",
    level_shares: tuple[float, ...] = (),
) -> tuple[Muscle, float]:
    """A muscle whose moduli are free in the fit; `strain` "stretch" is the constant-thickness reading.

    Moduli rise with the pressure, E_k(P) = E_k (1 - r/2 + r P/P_top) for the linear law; alike for others.
    A "free" law names its levels: the shares of the top level, in whole kPa.
    """
    muscle, top = tensile_muscle(family, rng, friction, order=order)
    base = np.array([c[0] for c in muscle.simulation.law.constants])
    if strain == "stretch":
        muscle = muscle.with_simulation(
            source="loops",
            kinematics="constant_thickness",
            strain="stretch",
            law=_stretch_law(muscle, top, order),
        )
        return muscle, top
    rise = rng.uniform(0.3, 0.7)
    levels_kPa = whole_levels(level_shares, top)
    made = {
        "constant": Law("constant", tuple((float(e),) for e in base)),
        "linear": Law("linear", tuple((rise * e / top, (1.0 - 0.5 * rise) * e) for e in base)),
        "exponential": Law(
            "exponential", tuple((0.8 * e, -0.5 * e) for e in base), rates=(0.5 * rise / top, -4.0 / top)
        ),
        "free": Law(
            "free",
            levels_kPa=levels_kPa,
            constants=tuple(tuple(float(e * (0.75 + rise * p / top)) for p in levels_kPa) for e in base),
        ),
    }[law]
    return muscle.with_simulation(source="loops", law=made), top


def _stretch_law(muscle: Muscle, top: float, order: int) -> Law:
    """Linear law in stretches, least squares to the muscle's own static map (as labs calibrate)."""
    wanted = muscle.with_simulation(friction="none")
    p, gamma = np.meshgrid(np.linspace(0.2, 1.0, 9) * top, np.linspace(0.0, 0.25, 26))
    p, gamma = p.ravel(), gamma.ravel()
    blank = Law("linear", ((0.0, 0.0),) * order)
    thick = wanted.with_simulation(kinematics="constant_thickness", strain="stretch", law=blank)
    offset = static_force(thick, p, gamma)
    columns = []
    for k in range(order):
        for part in range(2):
            rows = [[0.0, 0.0] for _ in range(order)]
            rows[k][part] = 1e6
            one = thick.with_simulation(law=Law("linear", tuple(tuple(r) for r in rows)))
            columns.append(static_force(one, p, gamma) - offset)
    matrix = np.stack(columns, axis=1)
    norms = np.linalg.norm(matrix, axis=0)
    found = np.linalg.lstsq(matrix / norms, static_force(wanted, p, gamma) - offset, rcond=1e-12)[0] / norms
    pairs = 1e6 * found.reshape(order, 2)
    return Law("linear", tuple((float(a), float(b)) for a, b in pairs))


def sensible(m: Muscle, levels_kPa: tuple[float, ...]) -> bool:
    """Positive blocked force, a falling curve and a free contraction of 0.03-0.36 at every level."""
    for level in levels_kPa:
        free = free_contraction(m, level)
        if not 0.03 <= free <= 0.36:
            return False
        force = static_force(m, level, np.linspace(0.0, free, 40))
        if force[0] <= 0.0 or np.any(np.diff(force) > 1e-3 * force[0]):
            return False
    return True
