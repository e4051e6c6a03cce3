"""The declared simulation against the test rig's own, which shares no line with the package."""

from __future__ import annotations

import random

import numpy as np
import pytest
from rig.chain import force_of
from rig.muscle import Law, Muscle, Simulation, static_force
from rig.protocol import Protocol, Rows, record_rows
from rig.specimens import FAMILIES, geometry_of

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.chain import Chain
from mpam_calib.model.moduli import Law as PackageLaw
from mpam_calib.model.moduli import ModuliBlock
from mpam_calib.model.readings import FAR, TIMES, Readings
from mpam_calib.specimen.declaration import Braid, Geometry

from . import build

FRICTIONS = [("coulomb", False), ("coulomb", True), ("strand", False), ("strand", True), ("none", False)]
LAWS = ["constant", "linear", "exponential", "exponential_each", "free"]
ETA = np.zeros((1, 1))


def readings_of(rows: Rows) -> Readings:
    """The rig's rows as the package's readings."""
    return Readings(
        pressure=rows.pressure * 1e3,
        displacement=rows.displacement * 1e-3,
        sign=rows.direction,
        level=rows.level.astype(np.int64),
        time=rows.time,
        file_time=rows.time,
        time_at_level=rows.level_time,
        cycle=rows.cycle,
        test_cycle=rows.cycle,
        travel=rows.since_reversal * 1e-3,
        reversal=np.ones(rows.count),
        strokes_before=np.full((rows.count, 2), FAR),
        speed=rows.speed * 1e-3,
        behind=np.zeros(rows.count),
        relaxed=-np.expm1(-rows.level_time[:, None] / TIMES),
        pace=rows.speed * 1e-3,
    )


def made_law(name: str, order: int, top: float, levels: tuple[float, ...], rng: random.Random):
    """(rig's law, coefficients in the package's order, rates in SI)."""
    E = [rng.uniform(-1.0, 1.0) * 1e5 for _ in range(order)]
    F = [rng.uniform(-1.0, 1.0) * 1e5 for _ in range(order)]
    rates = [(rng.uniform(-1.0, 1.0) / top, rng.uniform(0.5, 8.0) / top) for _ in range(order)]  # d, gap
    if name == "constant":
        return Law(name, tuple((e,) for e in E)), E, {}
    if name == "linear":
        pairs = [(e / top, f) for e, f in zip(E, F, strict=True)]
        return Law(name, tuple(pairs)), [a / 1e3 for a, _ in pairs] + [b for _, b in pairs], {}
    if name == "exponential":
        d, gap = rates[0]
        law = Law(name, tuple(zip(E, F, strict=True)), rates=(d, d - gap))
        return law, E + F, {"d": d / 1e3, "gap": gap / 1e3}
    if name == "exponential_each":
        constants = tuple((e, d, f, d - gap) for e, f, (d, gap) in zip(E, F, rates, strict=True))
        named = {}
        for k, (d, gap) in enumerate(rates, start=1):
            named |= {f"d_{k}": d / 1e3, f"gap_{k}": gap / 1e3}
        return Law(name, constants), E + F, named
    table = [[rng.uniform(-1.0, 1.0) * 1e5 for _ in levels] for _ in range(order)]
    flat = [table[k][j] for j in range(len(levels)) for k in range(order)]
    return Law(name, tuple(tuple(row) for row in table), levels_kPa=levels), flat, {}


def package_geometry(m: Muscle) -> Geometry:
    g = m.geometry
    return Geometry(L0_mm=g.L0_mm, R0_mm=g.R0_mm, t0_mm=g.t0_mm, alpha0_deg=float(g.alpha0_deg))


@pytest.mark.parametrize("kinematics", ["inextensible_braid", "constant_thickness"])
@pytest.mark.parametrize("strain", ["engineering", "stretch"])
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(("friction", "by_pressure"), FRICTIONS)
def test_forces_of_random_muscles(kinematics, strain, law, friction, by_pressure):
    for seed in range(3):
        rng = random.Random(f"{kinematics}{strain}{law}{friction}{by_pressure}{seed}")
        g, b, top = geometry_of(FAMILIES[rng.choice(sorted(FAMILIES))], rng)
        order = rng.choice((1, 2, 3, 4))
        levels = tuple(float(round(top * share)) for share in (0.4, 0.7, 1.0))
        rig_law, coefficients, rates = made_law(law, order, top, levels, rng)
        factors = tuple(rng.uniform(0.02, 0.3) for _ in range(3 if by_pressure else 1))
        muscle = Muscle("random", g, b, Simulation(
            kinematics, strain, friction, factors, by_pressure, "loops", rig_law))  # fmt: skip
        stroke = rng.uniform(0.1, 0.25) * g.L0_mm
        protocol = Protocol(levels, cycles=1, rows_max=120, strokes_mm=(stroke,) * 3, pressure_noise_kPa=0.0)
        rows = record_rows(protocol, muscle, seed)
        expected = force_of(muscle, rows)

        declared = {
            "kinematics": kinematics, "strain": strain, "friction": friction,
            "friction_by_pressure": by_pressure, "order": order, "law": law,
        }  # fmt: skip
        recorded = build.loops(levels)
        made = build.specimen(
            declared, recorded, geometry=package_geometry(muscle),
            braid=Braid(E_br_GPa=b.E_br_GPa, nu_s=b.nu_s, R_br_mm=b.R_br_mm, n=b.n),
        )  # fmt: skip
        setting = draw_blueprint(build.with_force(made, np.ones(len(recorded.time_s)))).setting()
        assert setting is not None
        mean = np.array(coefficients)
        block = ModuliBlock(
            PackageLaw(law, order, setting.levels), 0.0, mean=mean, root=np.zeros((len(mean), 1))
        )
        chain = Chain(setting, block)
        names = chain.friction.names
        values = {name: np.array([[v]]) for name, v in zip(names, factors, strict=bool(names))}
        values |= {name: np.array([[v]]) for name, v in rates.items()}
        found = chain.force(values, ETA, readings_of(rows))[0]
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9 * float(np.abs(expected).max()))
        if friction != "none":
            assert np.abs(expected - static_rows(muscle, rows)).max() > 1e-3


def static_rows(muscle: Muscle, rows: Rows) -> np.ndarray:
    """The same without friction."""
    return force_of(muscle.with_simulation(friction="none"), rows)


def test_rows_without_a_branch_carry_no_friction():
    rng = random.Random(5)
    g, b, top = geometry_of(FAMILIES["pencil"], rng)
    muscle = Muscle("m", g, b, Simulation(law=Law("constant", ((5e4,),)), friction_value=(0.1,)))
    made = build.specimen({"order": 1, "law": "constant"}, build.loops(), geometry=package_geometry(muscle))
    setting = draw_blueprint(build.with_force(made, np.ones(72))).setting()
    assert setting is not None
    law = PackageLaw("constant", 1, setting.levels)
    chain = Chain(setting, ModuliBlock(law, 0.0, mean=np.array([5e4]), root=np.zeros((1, 1))))
    gamma = np.linspace(0.0, 0.3, 7)
    readings = Readings.at_rest(np.full(7, top * 1e3), gamma * g.L0_mm * 1e-3)
    found = chain.force({"K_f": np.array([[0.1]])}, ETA, readings)[0]
    assert found == pytest.approx(static_force(muscle, top, gamma), rel=1e-9)
