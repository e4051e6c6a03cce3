"""From a recipe (plain declared values) to a case: drawing the muscle and protocol, solving the sizes."""

from __future__ import annotations

import random
from dataclasses import dataclass, replace

import numpy as np

from .case import Case, Hidden
from .chain import Form, force_of
from .effects import form
from .muscle import Array, Muscle, static_force
from .nuisance import differences, left_over, nuisance_of
from .outside import Outside
from .protocol import Protocol, Rows, noise_sd, record_rows
from .specimens import FAMILIES, loops_muscle, sensible, tensile_muscle, whole_levels


@dataclass(frozen=True)
class Wanted:
    """An effect to hide: `multiple` is what the free numbers leave of its signature, in noise sds (rms)."""

    id: str
    form: str
    multiple: float
    sign: int


@dataclass(frozen=True)
class Recipe:
    """The declaration of one case; the numbers of muscle and protocol follow from `seed`."""

    name: str
    seed: int
    group: str
    design: str
    family: str
    moduli: str  # "tensile" or "loops"
    levels: int
    cycles: int
    speeds: int
    rows_max: int
    kinematics: str = "inextensible_braid"
    strain: str = "engineering"
    friction: str = "coulomb"
    law: str = "constant"
    order: int = 2
    motion: str = "triangle"
    dwell: bool = False
    floor: bool = False
    columns: bool = True
    effects: tuple[Wanted, ...] = ()
    outside: str = ""
    outside_multiple: float = 0.0


def _level_shares(rng: random.Random, count: int) -> tuple[float, ...]:
    """Arbitrary levels from about a third of the highest upwards, as shares of it."""
    if count == 1:
        return (1.0,)
    low = rng.uniform(0.25, 0.4)
    inner = [low + (1.0 - low) * (j + rng.uniform(-0.2, 0.2)) / (count - 1) for j in range(1, count - 1)]
    return (low, *inner, 1.0)


def _muscle(recipe: Recipe, rng: random.Random) -> tuple[Muscle, tuple[float, ...]]:
    """A sensible muscle and its levels: drawn again until it is sensible."""
    family = FAMILIES[recipe.family]
    for _ in range(50):
        fork = random.Random(rng.getrandbits(48))
        shares = _level_shares(fork, recipe.levels)
        if recipe.moduli == "tensile":
            muscle, top = tensile_muscle(family, fork, recipe.friction, recipe.kinematics, recipe.order)
        else:
            muscle, top = loops_muscle(
                family, fork, recipe.law, recipe.order, recipe.friction, recipe.strain, shares
            )
        levels = whole_levels(shares, top)
        if sensible(muscle, levels):
            return muscle, levels
    raise ValueError(f"no sensible muscle for {recipe.name}")


def _protocol(recipe: Recipe, muscle: Muscle, levels: tuple[float, ...], rng: random.Random) -> Protocol:
    blocked = float(static_force(muscle, levels[-1], 0.0)[0])
    noise = blocked * rng.uniform(0.0015, 0.004)
    slow = 0.25 * muscle.geometry.L0_mm / rng.uniform(8.0, 25.0)
    speeds = [slow * rng.uniform(4.0, 9.0) ** j for j in range(recipe.speeds)]
    return Protocol(
        levels,
        recipe.cycles,
        tuple(float(f"{v:.3g}") for v in speeds),
        dwell_s=rng.uniform(1.0, 3.0) if recipe.dwell else 0.0,
        sampling_hz=rng.choice((10.0, 20.0, 50.0, 100.0)),
        rows_max=recipe.rows_max,
        motion=recipe.motion,
        stroke_fraction=1.04 if recipe.floor else rng.uniform(0.75, 0.88),
        pause_s=rng.uniform(5.0, 40.0),
        noise_N=noise,
        correlated_N=noise * rng.uniform(0.3, 0.7),
        correlation_s=rng.uniform(0.05, 0.3),
        pressure_noise_kPa=0.1 * noise * levels[-1] / blocked,
        pressure_wander=rng.uniform(0.0, 0.004),
        floor_N=0.0 if recipe.floor else None,
        branch_column=recipe.columns or recipe.dwell,
    )


def _left_rms(
    f: Form, size: float, muscle: Muscle, rows: Rows, null: Array, columns: Array, noise: float, seed: int
) -> float:
    change = force_of(muscle, rows, [(f, size)], seed=seed) - null
    left = left_over(change, columns, nuisance_of(muscle, rows, noise), noise)
    return float(np.sqrt(np.mean(left**2)))


def solved_size(wanted: Wanted, muscle: Muscle, rows: Rows, noise: float, seed: int) -> float:
    """Size whose signature, less what the free numbers take up, has the wanted rms; in the sensible range.

    Sizes below the range are allowed for faint effects; the upper end is never passed.
    """
    f = form(wanted.id, wanted.form)
    if f.low == f.high:
        return f.low
    unit = f.unit(muscle, rows)
    nuisance = nuisance_of(muscle, rows, noise)
    null = force_of(muscle, rows)
    columns = differences(nuisance, np.zeros(nuisance.count), null, lambda m: force_of(m, rows))
    goal, sign = wanted.multiple * noise, wanted.sign if f.signed else 1
    size = 1.0
    for _ in range(6):
        rms = _left_rms(f, sign * size * unit, muscle, rows, null, columns, noise, seed)
        size = float(np.clip(size * np.clip(goal / max(rms, 1e-12), 0.01, 10.0), 1e-4, f.high))
    return float(f"{sign * size * unit:.4g}")


def _stopped_at_zero_force(
    p: Protocol, muscle: Muscle, rows: Rows, hidden: tuple[Hidden, ...], recipe: Recipe
) -> Protocol:
    """Nobody pushes a muscle together: strokes end before the true force (friction and all) is zero."""
    if recipe.floor:
        return p
    force = force_of(muscle, rows, [(form(h.id, h.form), h.size) for h in hidden], seed=recipe.seed)
    strokes = []
    for level in range(len(p.levels_kPa)):
        here = rows.level == level
        stroke = float(rows.stroke[here][0])
        pushed = here & (force < 0.0)
        if pushed.any():
            # Never below a quarter of the plan: such a level stays in the test, partly pushed.
            stroke = max(0.9 * float(rows.displacement[pushed].min()), 0.25 * stroke)
        strokes.append(float(f"{stroke:.4g}"))
    return replace(p, strokes_mm=tuple(strokes))


def build_case(recipe: Recipe) -> Case:
    """The case a recipe declares."""
    rng = random.Random(recipe.seed)
    muscle, levels = _muscle(recipe, rng)
    protocol = _protocol(recipe, muscle, levels, rng)
    rows = record_rows(protocol, muscle, recipe.seed)
    noise = noise_sd(protocol)
    hidden = tuple(
        Hidden(w.id, w.form, solved_size(w, muscle, rows, noise, recipe.seed)) for w in recipe.effects
    )
    protocol = _stopped_at_zero_force(protocol, muscle, rows, hidden, recipe)
    outside = Outside(recipe.outside, recipe.outside_multiple * noise) if recipe.outside else None
    return Case(recipe.name, recipe.seed, recipe.group, muscle, protocol, hidden, outside)


def halved(case: Case) -> Case:
    """The same case with every effect at half its size; kinematics are one or the other and stay."""
    hidden = tuple(h if h.id == "braid_kinematics" else replace(h, size=0.5 * h.size) for h in case.hidden)
    return replace(case, hidden=hidden)
