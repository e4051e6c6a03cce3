"""From the rows of a test to the force: the declared simulation with effects plugged into its stages.

Order of stages: rig, shape, statics, friction, history, sensor. An effect changes the `State`; effects that
depend on the force itself (`feedback`) are resolved by fixed-point iteration on the transmitted force.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from .muscle import (
    Array,
    Geometry,
    Muscle,
    Shape,
    gas_force,
    polynomial_stress,
    shape_of,
    strains,
    strand_friction,
    wall_force,
)
from .protocol import Rows

STAGES = ("rig", "shape", "statics", "friction", "history", "sensor")


@dataclass
class State:
    """What effects may change; arrays are per row.

    pressure [kPa] and shortening [mm] are what the muscle sees; angles are (offset of alpha0 [deg], weight);
    tip(geometry, R) is the length [mm] lost in the end pieces; stretch(geometry, L, P) the strands' stretch;
    thickness(shape, P) factors multiply the thickness term; bends(P) factors multiply all moduli;
    stresses(e, P) are added to the wall's stress [N/mm2]; statics(geometry, L, P) are added forces [N];
    frictions(F0, P, gamma) are magnitudes [N]; turn is the signed direction; rate multiplies all friction;
    history multiplies the force; sensor is added to the reading.
    """

    muscle: Muscle
    rows: Rows
    seed: int
    force: Array
    pressure: Array
    shortening: Array
    turn: Array
    angles: list[tuple[float, float]] = field(default_factory=lambda: [(0.0, 1.0)])
    angle_drift: Array | float = 0.0
    shape: Callable[[Geometry, Array, Array | float], Shape] | None = None
    tip: Callable[[Geometry, Array], Array] | None = None
    stretch: Callable[[Geometry, Array, Array], Array] | None = None
    thickness: list[Callable[[Shape, Array], Array]] = field(default_factory=list)
    bends: list[Callable[[Array], Array]] = field(default_factory=list)
    stresses: list[Callable[[Array, Array], Array]] = field(default_factory=list)
    statics: list[Callable[[Geometry, Array, Array], Array]] = field(default_factory=list)
    frictions: list[Callable[[Array, Array, Array], Array]] = field(default_factory=list)
    rate: Array | float = 1.0
    history: list[Callable[[Array], Array]] = field(default_factory=list)
    sensor: Array | float = 0.0


@dataclass(frozen=True)
class Form:
    """One functional form of an effect.

    `unit(muscle, rows)` is a size 1 in the contract's unit, `low`..`high` the sensible range in units;
    `signed` effects may take either sign; `feedback` ones need the force.
    """

    id: str
    name: str
    parameter: str
    stage: str
    apply: Callable[[State, float], None]
    unit: Callable[[Muscle, Rows], float]
    low: float = 0.1
    high: float = 4.0
    signed: bool = False
    feedback: bool = False
    shared: bool = False


Sized = tuple[Form, float]


def _declared_friction(m: Muscle, rows: Rows) -> Callable[[Array, Array, Array], Array] | None:
    sim = m.simulation
    if sim.friction == "none":
        return None
    values = np.asarray(sim.friction_value, dtype=float)
    value = values[rows.level.astype(int)] if sim.friction_by_pressure else values[0]
    if sim.friction == "coulomb":
        return lambda force, pressure, gamma: value * np.abs(force)
    braid = m.braid
    if braid is None:
        raise ValueError("strand friction needs the braid")
    return lambda force, pressure, gamma: value * strand_friction(m.geometry, braid, pressure, gamma)


def _static(state: State, offset_deg: float) -> tuple[Array, Array]:
    """Friction-free force [N] and contraction of the working length, for one braid angle."""
    m, sim = state.muscle, state.muscle.simulation
    g = m.geometry
    angle = g.alpha0_deg + offset_deg + state.angle_drift
    g = Geometry(g.L0_mm, g.R0_mm, g.t0_mm, angle)
    pressure, length = state.pressure, g.L0_mm - state.shortening
    stretch: Array | float = 1.0 if state.stretch is None else state.stretch(g, length, pressure)
    build = state.shape or (lambda geo, L, k: shape_of(geo, L, sim.kinematics, k))
    s = build(g, length, stretch)
    if state.tip is not None:
        s = build(g, length - state.tip(g, s.R), stretch)
    thickness: Array | float = 1.0
    for factor in state.thickness:
        thickness = thickness * factor(s, pressure)
    moduli = sim.law.moduli(pressure, state.rows.setpoint)
    for bend in state.bends:
        moduli = moduli * bend(pressure)
    z, x = strains(g, s, sim.strain)
    axial, hoop = polynomial_stress(moduli, z), polynomial_stress(moduli, x)
    for stress in state.stresses:
        axial, hoop = axial + stress(z, pressure), hoop + stress(x, pressure)
    force = gas_force(pressure, s, thickness) + wall_force(s, axial, hoop)
    for extra in state.statics:
        force = force + extra(g, s.L, pressure)
    return force, 1.0 - s.L / g.L0_mm


def _pass(
    m: Muscle, rows: Rows, effects: Sequence[Sized], pressure: Array, seed: int, force: Array
) -> tuple[Array, Array]:
    """One evaluation with a given transmitted force: (transmitted force, load-cell reading)."""
    state = State(m, rows, seed, force, pressure, rows.displacement, rows.direction)
    for form, size in effects:
        form.apply(state, size)
    static: Array = np.zeros(rows.count)
    gamma: Array = np.zeros(rows.count)
    for offset, weight in state.angles:
        one, contraction = _static(state, offset)
        static, gamma = static + weight * one, gamma + weight * contraction
    declared = _declared_friction(m, rows)
    magnitude: Array = np.zeros(rows.count)
    for friction in ([declared] if declared else []) + state.frictions:
        magnitude = magnitude + friction(static, state.pressure, gamma)
    total = static + state.turn * state.rate * magnitude
    for step in state.history:
        total = step(total)
    return total, total + state.sensor


def force_of(
    m: Muscle, rows: Rows, effects: Sequence[Sized] = (), pressure: Array | None = None, seed: int = 0
) -> Array:
    """Noise-free load-cell reading [N] per row; `pressure` [kPa] is what the muscle is given."""
    given = rows.pressure if pressure is None else pressure
    ordered = sorted(effects, key=lambda e: (STAGES.index(e[0].stage), e[0].id))
    total, reading = _pass(m, rows, ordered, given, seed, np.zeros(rows.count))
    if not any(form.feedback for form, _ in ordered):
        return reading
    for _ in range(40):
        last = total
        total, reading = _pass(m, rows, ordered, given, seed, last)
        if float(np.abs(total - last).max()) < 1e-9 * max(1.0, float(np.abs(total).max())):
            break
    return reading
