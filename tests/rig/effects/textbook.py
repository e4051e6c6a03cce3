"""Alternatives to the textbook forms, in the practice set alone: which shapes can a catalogue hold?

Each is a curve that another author would as soon have written: hyperbolic instead of exponential, the
square of the stroke instead of the stroke, a drift that comes back.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..chain import Form, State
from ..muscle import Array, Geometry, Shape, strand_friction
from . import friction_stage, history_stage, rig_stage, shape_stage, statics_stage

Apply = Callable[[State, float], None]
Curve = Callable[[Array], Array]


def _top(state: State) -> float:
    return float(state.rows.setpoint.max())


def _blocked(state: State) -> float:
    return max(rig_stage.blocked_top(state.muscle, state.rows), 1e-9)


# --- rig ---------------------------------------------------------------------------------------------------


def _hyperbolic(state: State, size: float) -> None:
    """P -> P - P_DB P/(P + P_DB)."""
    p = state.pressure
    state.pressure = np.maximum(p - size * p / (p + abs(size) + 1e-9), 0.0)


def _smooth_maximum(state: State, size: float) -> None:
    """P -> the branch above zero of a hyperbola with asymptotes 0 and P - P_DB, w = 0.1 P_max."""
    p, w = state.pressure, 0.1 * _top(state)
    lost = 0.5 * (np.hypot(p, w) + p) - 0.5 * (np.hypot(p - size, w) + p - size)
    state.pressure = np.maximum(p - lost, 0.0)


def _droop(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        state.pressure = state.pressure * (1.0 - 0.01 * size * curve(state.rows.fraction))

    return apply


def _slipping(state: State, size: float) -> None:
    t = state.rows.time
    state.shortening = state.shortening + size * (0.8 + 0.4 * t / t.max())


def _fixture(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        scale = _blocked(state)
        state.shortening = state.shortening + size * scale * curve(state.force / scale)

    return apply


# --- shape and statics -------------------------------------------------------------------------------------


def _cap_tip(g: Geometry, radius: Array) -> Array:
    """Slant minus axial length of ends that rise over 0.6 R."""
    rise = radius - g.R0_mm
    return 2.0 * np.sign(rise) * (np.hypot(rise, 0.6 * radius) - 0.6 * radius)


def _quadratic_tip(g: Geometry, radius: Array) -> Array:
    rise = radius - g.R0_mm
    return 1.8 * rise * np.abs(rise) / radius


def _angle(along: Callable[[State], Array]) -> Apply:
    def apply(state: State, size: float) -> None:
        state.angle_drift = state.angle_drift + size * along(state)

    return apply


def _soft_strands(state: State, size: float) -> None:
    m, top = state.muscle, _top(state)
    state.statics.append(
        lambda g, length, p: (
            -size
            * shape_stage.strand_energy_force(m, g, length, p)
            * np.sqrt(0.6 + 0.4 * top / np.maximum(p, 1e-3))
        )
    )


def _wall(along: Callable[[Shape, Array, float], Array]) -> Apply:
    def apply(state: State, size: float) -> None:
        top = _top(state)
        state.thickness.append(lambda s, p: 1.0 - size * along(s, p, top))

    return apply


def _law(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        levels = state.rows.setpoint
        low, span = levels.min(), max(float(np.ptp(levels)), 1e-9)
        state.bends.append(lambda p: np.maximum(1.0 + size * curve((p - low) / span), 0.02))

    return apply


def _stress(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        largest, stress = statics_stage._hoop_reference(state)
        state.stresses.append(lambda e, p: size * stress * curve(e / largest))

    return apply


# --- friction ----------------------------------------------------------------------------------------------


def _opening_strands(state: State, size: float) -> None:
    m, braid = state.muscle, state.muscle.braid
    if braid is None:
        raise ValueError("strand friction needs the braid")
    state.frictions.append(
        lambda force, p, gamma: size * strand_friction(m.geometry, braid, p, gamma) * (1.0 + 1.5 * gamma)
    )


def _superlinear(state: State, size: float) -> None:
    scale = 0.5 * _blocked(state)
    state.frictions.append(lambda force, p, gamma: size * scale * (np.abs(force) / scale) ** 1.2)


def _with_contraction(state: State, size: float) -> None:
    state.frictions.append(lambda force, p, gamma: size * np.abs(force) * (1.0 + 1.2 * gamma))


def _speed(state: State) -> Array:
    rows = state.rows
    return np.maximum(rows.speed, 0.03 * rows.nominal_speed) / friction_stage.reference_speed(rows)


def _eyring(state: State, size: float) -> None:
    state.rate = state.rate * (1.0 + size * (np.arcsinh(2.0 * _speed(state)) - np.arcsinh(2.0)))


def _dashpot(state: State, size: float) -> None:
    """Beside the declared friction, in proportion to the speed and to nothing else."""
    unit, v = 0.02 * _blocked(state) / np.log(10.0), _speed(state)
    state.frictions.append(lambda force, p, gamma: size * unit * v)


def _turning(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        if size > 0.0:
            state.turn = state.turn * (2.0 * curve(state.rows.since_reversal / size) - 1.0)

    return apply


# --- history and sensor ------------------------------------------------------------------------------------


def _softening(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        excess = curve(state.rows.cycle - 1.0)
        state.history.append(lambda force: force * (1.0 + size * excess))

    return apply


def _creep(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        t = state.rows.level_time
        end = max(float(t.max()), 2.0)
        relaxed = np.log10(1.0 + end) * curve(t / end)
        state.history.append(lambda force: force * (1.0 - size * relaxed))

    return apply


def _drift(curve: Curve) -> Apply:
    def apply(state: State, size: float) -> None:
        t = state.rows.time
        state.sensor = state.sensor + size * float(t.max()) / 60.0 * curve(t / t.max())

    return apply


_APPLY: dict[str, dict[str, Apply]] = {
    "dead_band": {"hyperbolic": _hyperbolic, "smooth_maximum": _smooth_maximum},
    "pressure_droop": {
        "smoothstep": _droop(lambda u: u**2 * (3.0 - 2.0 * u)),
        "saturating": _droop(lambda u: -np.expm1(-2.0 * u) / -np.expm1(-2.0)),
    },
    "length_offset": {"slipping": _slipping},
    "rig_compliance": {
        "logarithmic": _fixture(lambda f: np.sign(f) * np.log1p(2.0 * np.abs(f)) / np.log(3.0)),
        "cubic": _fixture(lambda f: f * (1.15 - 0.4 * np.minimum(np.abs(f), 1.2) ** 2)),
    },
    "tip_shape": {"cap": shape_stage._tip(_cap_tip), "quadratic": shape_stage._tip(_quadratic_tip)},
    "braid_angle": {
        "relaxing": _angle(lambda s: 1.2 - 0.4 * s.rows.level_fraction),
        "locking": _angle(lambda s: 1.0 - 0.4 * np.exp(-3.0 * s.pressure / _top(s))),
    },
    "braid_stretch": {"soft_start": _soft_strands},
    "wall_pressure": {
        "radius": _wall(lambda s, p, top: 1.0 - 0.3 * s.R / s.R.max()),
        "langmuir": _wall(lambda s, p, top: p / (p + 0.25 * top)),
    },
    "law_shape": {
        "cubic": _law(lambda v: (2.0 * v - 1.0) ** 3),
        "decay": _law(lambda v: np.exp(-4.0 * v) - 0.3),
        "hump": _law(lambda v: np.exp(-(((v - 0.5) / 0.25) ** 2)) - 0.5),
    },
    "order_too_low": {
        "hinge": _stress(lambda u: np.maximum(u - 0.4, 0.0) ** 2 / 0.36),
        "saturating": _stress(lambda u: np.tanh(2.5 * u) - 0.75 * u),
    },
    "strand_friction": {"opening": _opening_strands},
    "coulomb_friction": {"superlinear": _superlinear, "with_contraction": _with_contraction},
    "rate_friction": {"eyring": _eyring, "dashpot": _dashpot},
    "presliding": {
        "ramp": _turning(lambda d: np.minimum(0.5 * d, 1.0)),
        "arctangent": _turning(lambda d: 2.0 / np.pi * np.arctan(2.0 * d)),
        "algebraic": _turning(lambda d: d / np.sqrt(1.0 + d**2)),
    },
    "stress_softening": {
        "inverse": _softening(lambda c: 1.0 / (1.0 + c)),
        "slow": _softening(lambda c: np.exp(-c / 2.5)),
    },
    "creep": {
        "single": _creep(lambda t: -np.expm1(-t / 0.15)),
        "early": _creep(lambda t: -np.expm1(-t / 0.03)),
        "root": _creep(np.sqrt),
    },
    "force_drift": {
        "root": _drift(np.sqrt),
        "early": _drift(lambda u: -np.expm1(-10.0 * u)),
        "returning": _drift(lambda u: 4.0 * u * (1.0 - u)),
        "waves": _drift(lambda u: 0.4 * u + 0.6 * np.sin(2.4 * np.pi * u)),
    },
}

_SHARED = {
    form.id: form
    for stage in (rig_stage, shape_stage, statics_stage, friction_stage, history_stage)
    for form in stage.FORMS
    if form.shared
}

FORMS: tuple[Form, ...] = tuple(
    replace(_SHARED[effect], name=name, apply=apply, shared=False)
    for effect, forms in _APPLY.items()
    for name, apply in forms.items()
)
