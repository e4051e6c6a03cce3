"""Tests as other labs drive and write them: what `protocol.py` does not do, drawn at random from a seed.

Strokes that grow, that do not come back to the initial length or that hold a smaller loop; trapezoids; speeds
that change from cycle to cycle; readings anywhere in a step, at uneven times, with rows lost; levels in any
order; coarse encoders; columns left out; a file for each level, with a clock of its own. What is hidden has
the plain textbook form, or one of `conventions.py`.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from .case import Case, specimen_toml
from .chain import Form, force_of
from .conventions import CONVENTIONS
from .effects import shared_form
from .muscle import Array, Muscle, free_contraction, static_force
from .protocol import Protocol, Rows, sensor_noise
from .recipes import Wanted, solved_size
from .specimens import FAMILIES, loops_muscle, sensible, tensile_muscle, whole_levels

SEEN_BY_LOOPS = (
    "stress_softening", "creep", "force_drift", "rate_friction", "presliding", "rig_compliance",
    "pressure_droop", "length_offset",
)  # fmt: skip
SEEN_BY_TENSILE = (
    *SEEN_BY_LOOPS, "tip_shape", "wall_pressure", "law_shape", "order_too_low", "braid_angle", "dead_band",
    "braid_stretch", "braid_kinematics", "strand_friction", "coulomb_friction",
)  # fmt: skip
SEEN_MM = 0.08
"""A shorter way of presliding lies between two readings."""
PATHS = ("full", "full", "growing", "raised", "nested")
ROWS = 3000


@dataclass(frozen=True)
class Habits:
    """How a lab drives its crosshead and writes its files; encoders' steps in the columns' units."""

    path: str
    motion: str
    dwell_s: float
    cycles: int
    speeds_mm_s: tuple[float, ...]
    mixed: bool
    uneven: float
    lost: float
    force_step: float
    displacement_step: float
    pressure_step: float
    columns: tuple[str, ...]
    a_file_each: bool
    semicolons: bool
    decimals: int


@dataclass(frozen=True)
class Unusual:
    """A drawn test: what is hidden with its sizes, who hides it and how it was recorded."""

    case: Case
    habits: Habits
    sizes: dict[str, float]
    rows: Rows
    force: Array


def draw(seed: int, count: int, convention: str | None = None) -> Unusual | None:
    """A test with so many causes, one of them by this convention; None where the muscle cannot carry it."""
    rng = random.Random(1000 * count + seed)
    other = None if convention is None else CONVENTIONS[convention]
    ids, muscle, levels = _specimen(rng, count, None if other is None else other.id)
    habits = _habits(rng, ids)
    if convention == "tared":
        habits = replace(habits, a_file_each=True)
    if convention == "by_the_stroke":
        habits = replace(habits, motion="sine", dwell_s=3.0)
    blocked = float(static_force(muscle, np.array([max(levels)]), np.array([0.0]))[0])
    white = blocked * rng.choice([0.0015, 0.003, 0.004])
    protocol = Protocol(
        levels_kPa=levels, noise_N=white, correlated_N=white * rng.choice([0.0, 0.5]),
        correlation_s=rng.choice([0.03, 0.1, 0.2]), pressure_noise_kPa=rng.choice([0.0, 0.02]),
    )  # fmt: skip
    noise = float(np.hypot(protocol.noise_N, protocol.correlated_N))
    wanted = [Wanted(i, shared_form(i).name, rng.uniform(2.5, 8.0), rng.choice([-1, 1])) for i in ids]
    share = rng.uniform(0.6, 0.9)
    for _ in range(4):
        rows = _rows(protocol, habits, muscle, share, seed)
        sizes = {w.id: solved_size(w, muscle, rows, noise, seed) for w in wanted}
        hidden = [(_form(i, other), z) for i, z in sizes.items()]
        force = force_of(muscle, rows, hidden, seed=seed)
        if sizes.get("presliding", np.inf) < SEEN_MM:
            return None
        if not np.any(force < 0.0):  # nobody pushes a muscle together
            case = Case(f"unusual-{count}-{seed}", seed, "unusual", muscle, protocol)
            return Unusual(case, habits, sizes, rows, force + sensor_noise(protocol, rows, seed))
        share *= 0.85
    return None


def _form(identifier: str, other: Form | None) -> Form:
    return other if other is not None and other.id == identifier else shared_form(identifier)


def _specimen(
    rng: random.Random, count: int, needed: str | None
) -> tuple[list[str], Muscle, tuple[float, ...]]:
    while True:
        tensile = rng.random() < 0.6
        ids = sorted(rng.sample(SEEN_BY_TENSILE if tensile else SEEN_BY_LOOPS, count))
        if needed is not None and needed not in ids:
            continue
        if {"coulomb_friction", "strand_friction"} <= set(ids):
            continue
        frictions = ["coulomb", "strand", "none"]
        if {"rate_friction", "presliding"} & set(ids):
            frictions.remove("none")
        for name in ("coulomb", "strand"):
            if f"{name}_friction" in ids:
                frictions.remove(name)
        friction = rng.choice(frictions)
        own = "coulomb" if friction == "none" else friction
        family = rng.choice(list(FAMILIES.values()))
        if tensile:
            both = ["constant_thickness"] + ["inextensible_braid"] * ("braid_kinematics" not in ids)
            made = tensile_muscle(
                family, rng, friction=own, kinematics=rng.choice(both), order=rng.choice([1, 2, 3])
            )
        else:
            law = rng.choice(["linear", "constant"])
            made = loops_muscle(
                family, rng, law=law, order=rng.choice([2, 3]), friction=own, strain="engineering"
            )
        muscle, top = made
        if friction == "none":
            muscle = muscle.with_simulation(friction="none")
        levels = whole_levels(tuple(np.linspace(rng.uniform(0.3, 0.42), 1.0, rng.choice([5, 6, 7]))), top)
        if sensible(muscle, levels):
            return ids, muscle, _ordered(rng, levels)


def _ordered(rng: random.Random, levels: tuple[float, ...]) -> tuple[float, ...]:
    order = list(levels)
    how = rng.choice(["up", "down", "any"])
    if how == "any":
        rng.shuffle(order)
    return tuple(order[::-1] if how == "down" else order)


def _habits(rng: random.Random, ids: list[str]) -> Habits:
    base = rng.uniform(0.5, 5.0)
    speeds = 2 if "rate_friction" in ids else rng.choice([1, 2])
    pace = tuple(base * rng.uniform(4.0, 9.0) ** i for i in range(speeds))
    # What the first cycles soften is not the same rubber in every cycle where strokes grow.
    whole = "stress_softening" in ids
    # Friction by speed has no textbook value where the crosshead stands, or nearly so.
    moving = "rate_friction" in ids
    return Habits(
        path="full" if whole else rng.choice(PATHS),
        motion="triangle" if moving else rng.choice(["triangle", "sine", "trapezoid"]),
        dwell_s=0.0 if moving else rng.choice([0.0, 0.0, 0.5, 3.0]),
        cycles=rng.choice([3, 4]),
        speeds_mm_s=pace,
        mixed=not whole and rng.random() < 0.4,
        uneven=rng.choice([0.0, 0.0, 0.2]),
        lost=rng.choice([0.0, 0.0, 0.03]),
        force_step=rng.choice([0.0, 0.2]),
        displacement_step=rng.choice([0.0, 0.001, 0.005]),
        pressure_step=rng.choice([0.0, 0.02]),
        columns=tuple(name for name in ("setpoint_kPa", "cycle", "branch") if rng.random() < 0.6),
        a_file_each=rng.random() < 0.3,
        semicolons=rng.random() < 0.3,
        decimals=rng.choice([3, 4]),
    )


def _turns(habits: Habits, stroke: float) -> list[tuple[float, float, float, int]]:
    """Legs of a level: from, to (mm), speed (mm/s), cycle; every cycle goes out and comes back."""
    pairs: list[tuple[float, float]] = []  # (out to, back to)
    for k in range(habits.cycles):
        part = (k + 1) / habits.cycles
        pairs.append(
            {
                "full": (stroke, 0.0),
                "growing": (stroke * (0.35 + 0.65 * part), 0.0),
                "raised": (stroke, 0.2 * stroke),
                "nested": (stroke, 0.0) if k != 1 else (0.75 * stroke, 0.3 * stroke),
            }[habits.path]
        )
    paces = [(v, pair) for v in habits.speeds_mm_s for pair in pairs]
    if habits.mixed:
        paces = [(v, pair) for pair in pairs for v in habits.speeds_mm_s]
    legs, at = [], 0.0
    for number, (speed, (far, near)) in enumerate(paces):
        legs += [(at, far, speed, number + 1), (far, near, speed, number + 1)]
        at = near
    return legs


def _way(motion: str, x: Array) -> Array:
    """Share of a leg's way at shares x of its time."""
    x = np.clip(x, 0.0, 1.0)
    if motion == "triangle":
        return x
    if motion == "sine":
        return 0.5 * (1.0 - np.cos(np.pi * x))
    a = 0.12  # share of the time for speeding up, and for slowing down
    middle = (x - 0.5 * a) / (1.0 - a)
    ramp = 0.5 / (a * (1.0 - a))
    return np.where(x < a, ramp * x**2, np.where(x > 1.0 - a, 1.0 - ramp * (1.0 - x) ** 2, middle))


def _rows(p: Protocol, habits: Habits, muscle: Muscle, share: float, seed: int) -> Rows:
    rng = np.random.default_rng([seed, 21])
    parts: list[dict[str, Array]] = []
    clock = 0.0
    for level, pressure in enumerate(p.levels_kPa):
        stroke = share * muscle.geometry.L0_mm * free_contraction(muscle, pressure)
        legs = _turns(habits, stroke)
        start, travelled = clock, 0.0
        for a, b, speed, cycle in legs:
            length, duration = abs(b - a), abs(b - a) / speed
            per_leg = ROWS / len(p.levels_kPa) / len(legs)
            step = (duration + habits.dwell_s) / max(
                min(per_leg, 60.0), 12.0 * (1.0 + habits.dwell_s / duration)
            )
            times = np.arange(rng.uniform() * step, duration + habits.dwell_s, step)
            times = times + habits.uneven * step * rng.uniform(-1.0, 1.0, times.size)
            times = times[(times > 0.0) & (times < duration + habits.dwell_s)]
            times = times[rng.uniform(size=times.size) >= habits.lost]
            way = length * _way(habits.motion, times / duration)
            near = 1e-4 * duration
            ahead, behind = (_way(habits.motion, (times + h) / duration) for h in (near, -near))
            pace = length * (ahead - behind) / (2.0 * near)
            ones = np.ones(times.size)
            parts.append(
                {
                    "time": clock + times, "setpoint": pressure * ones, "level": level * ones,
                    "displacement": a + np.sign(b - a) * way, "direction": -np.sign(b - a) * ones,
                    "speed": np.where(times >= duration, 0.0, pace), "nominal_speed": speed * ones,
                    "since_reversal": way, "travel": travelled + way, "stroke": stroke * ones,
                    "cycle": cycle * ones, "level_time": clock + times - start,
                }
            )  # fmt: skip
            clock += duration + habits.dwell_s
            travelled += length
        clock += p.pause_s
    joined = {k: np.concatenate([part[k] for part in parts]) for k in parts[0]}
    ripple = p.pressure_wander * np.sin(2.0 * np.pi * joined["time"] / 37.0 + rng.uniform(0.0, 2.0 * np.pi))
    pressure = joined["setpoint"] * (1.0 + ripple)
    reading = pressure + p.pressure_noise_kPa * rng.standard_normal(pressure.size)
    return Rows(pressure=pressure, reading=reading, **joined)


def write(made: Unusual, folder: Path) -> None:
    """Write the specimen folder."""
    habits, rows = made.habits, made.rows
    folder.mkdir(parents=True)
    toml = specimen_toml(made.case, {"loops": "loops.csv"})
    levels = range(len(made.case.protocol.levels_kPa))
    if habits.a_file_each:
        names = [f"loops_{k}.csv" for k in levels]
        for k, name in zip(levels, names, strict=True):
            (folder / name).write_text(_table(made, np.flatnonzero(rows.level == k)), encoding="utf-8")
        listed = ", ".join(f'"{name}"' for name in names)
        toml = toml.replace('loops = "loops.csv"', f"loops = [{listed}]")
    else:
        (folder / "loops.csv").write_text(_table(made, np.arange(rows.count)), encoding="utf-8")
    (folder / "specimen.toml").write_text(toml, encoding="utf-8")


def _rounded(x: Array, step: float) -> Array:
    return np.round(x / step) * step if step else x


def _table(made: Unusual, at: Array) -> str:
    habits, rows, noise = made.habits, made.rows, made.case.protocol.noise_N
    clock = rows.time[at] - (rows.time[at[0]] if habits.a_file_each else 0.0)
    columns = {
        "time_s": [f"{t:.{habits.decimals}f}" for t in clock],
        "pressure_kPa": [f"{v:.4f}" for v in _rounded(rows.reading[at], habits.pressure_step)],
        "displacement_mm": [f"{v:.6f}" for v in _rounded(rows.displacement[at], habits.displacement_step)],
        "force_N": [f"{v:.6f}" for v in _rounded(made.force[at], habits.force_step * noise)],
    }
    optional = {
        "setpoint_kPa": [f"{v:g}" for v in rows.setpoint[at]],
        "cycle": [f"{int(v)}" for v in rows.cycle[at]],
        "branch": ["loading" if v > 0 else "unloading" for v in rows.direction[at]],
    }
    columns |= {name: optional[name] for name in habits.columns}
    lines = [list(columns), *map(list, zip(*columns.values(), strict=True))]
    if habits.semicolons:
        lines = [lines[0], *([v.replace(".", ",") for v in line] for line in lines[1:])]
    return "\n".join((";" if habits.semicolons else ",").join(line) for line in lines) + "\n"
