"""Effects between the readings and what the muscle really sees: pressure, length, fixture."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..chain import Form, State
from ..muscle import Array, Muscle, static_force
from ..protocol import Rows


def blocked_top(m: Muscle, rows: Rows) -> float:
    """Blocked force [N] of the declared muscle at the highest level."""
    return float(abs(static_force(m, rows.setpoint.max(), 0.0)[0]))


# --- dead band: P_DB [kPa] ---------------------------------------------------------------------------------


def _sharp(state: State, size: float) -> None:
    """P -> max(P - P_DB, 0)."""
    state.pressure = np.maximum(state.pressure - size, 0.0)


def _softplus(state: State, size: float) -> None:
    """P -> P - [h(P) - h(P - P_DB)], h(p) = w log(1 + exp(p/w)), w = 0.12 P_max: a soft onset.

    The whole band is lost at high pressure, less of it where the liner only begins to meet the braid.
    """
    w = 0.12 * float(state.rows.setpoint.max())
    p = state.pressure
    lost = w * (np.logaddexp(0.0, p / w) - np.logaddexp(0.0, (p - size) / w))
    state.pressure = np.maximum(p - lost, 0.0)


def _closing_gap(state: State, size: float) -> None:
    """P -> P - P_DB (1 - exp(-P / p1)), p1 = 0.15 P_max: the gap closes as the pressure rises."""
    p1 = 0.15 * float(state.rows.setpoint.max())
    p = state.pressure
    state.pressure = np.maximum(p - size * (1.0 - np.exp(-p / p1)), 0.0)


def _dead_band_unit(m: Muscle, rows: Rows) -> float:
    return 0.04 * float(rows.setpoint.max())


# --- pressure droop: percent at full stroke ----------------------------------------------------------------


def _droop(shape: str) -> Callable[[State, float], None]:
    def apply(state: State, size: float) -> None:
        u = state.rows.fraction
        bent = {
            "linear": u,
            "quadratic": u**2,
            "cosine": 0.5 * (1.0 - np.cos(np.pi * u)),
            "root": np.sqrt(np.maximum(u, 0.0)) * u,
        }[shape]
        state.pressure = state.pressure * (1.0 - 0.01 * size * bent)

    return apply


# --- length offset [mm] ------------------------------------------------------------------------------------


def _offset(state: State, size: float) -> None:
    state.shortening = state.shortening + size


def _offset_settling(state: State, size: float) -> None:
    """The clamp slips early in the test: offset (1 - 0.4 exp(-time / one twentieth of the test))."""
    t = state.rows.time
    state.shortening = state.shortening + size * (1.0 - 0.4 * np.exp(-20.0 * t / t.max()))


def _offset_scale(state: State, size: float) -> None:
    """A scale error comes with it: offset (1 + 0.25 u) over the stroke fraction u."""
    state.shortening = state.shortening + size * (1.0 + 0.25 * state.rows.fraction)


# --- fixture that gives: mm per N --------------------------------------------------------------------------


def _compliance(state: State, size: float) -> None:
    state.shortening = state.shortening + size * state.force


def _reference(state: State) -> float:
    return max(blocked_top(state.muscle, state.rows), 1e-9)


def _hertz(state: State, size: float) -> None:
    """Stiffening contact: c F1 (F/F1)^(2/3), F1 half the top blocked force."""
    f1 = 0.5 * _reference(state)
    bent = np.sign(state.force) * np.abs(state.force / f1) ** (2 / 3)
    state.shortening = state.shortening + size * f1 * bent


def _toe(state: State, size: float) -> None:
    """A soft toe, then linear: c (F + 0.5 F1 (1 - exp(-|F|/F1)) sign F), F1 a fifth of the blocked force."""
    f1 = 0.2 * _reference(state)
    slack = 0.5 * f1 * (1.0 - np.exp(-np.abs(state.force) / f1)) * np.sign(state.force)
    state.shortening = state.shortening + size * (state.force + slack)


def _progressive(state: State, size: float) -> None:
    """Series of a linear and a hardening spring: c F (1.3 - 0.6 |F|/F_b)."""
    share = np.minimum(np.abs(state.force) / _reference(state), 1.0)
    state.shortening = state.shortening + size * state.force * (1.3 - 0.6 * share)


def _compliance_unit(m: Muscle, rows: Rows) -> float:
    return 0.006 * m.geometry.L0_mm / blocked_top(m, rows)


def _length_unit(m: Muscle, rows: Rows) -> float:
    return 0.005 * m.geometry.L0_mm


def _two_percent(m: Muscle, rows: Rows) -> float:
    return 2.0


def _form(
    effect: str,
    name: str,
    parameter: str,
    apply: Callable[[State, float], None],
    unit: Callable[[Muscle, Rows], float],
    **more: Any,
) -> Form:
    return Form(effect, name, parameter, "rig", apply, unit, **more)


FORMS: tuple[Form, ...] = (
    *(
        _form("dead_band", name, "P_DB_kPa", apply, _dead_band_unit, high=3.0, shared=name == "sharp")
        for name, apply in (("sharp", _sharp), ("softplus", _softplus), ("closing_gap", _closing_gap))
    ),
    *(
        _form("pressure_droop", name, "droop_percent", _droop(name), _two_percent, shared=name == "linear")
        for name in ("linear", "quadratic", "cosine", "root")
    ),
    *(
        _form("length_offset", name, "offset_mm", apply, _length_unit, signed=True, shared=name == "constant")
        for name, apply in (("constant", _offset), ("settling", _offset_settling), ("scale", _offset_scale))
    ),
    *(
        _form(
            "rig_compliance",
            name,
            "compliance_mm_per_N",
            apply,
            _compliance_unit,
            feedback=True,
            shared=name == "linear",
        )
        for name, apply in (
            ("linear", _compliance),
            ("hertz", _hertz),
            ("toe", _toe),
            ("progressive", _progressive),
        )
    ),
)

__all__ = ["FORMS", "Array", "blocked_top"]
