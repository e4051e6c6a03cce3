"""Effects on the friction: its origin, its dependence on speed, its turning over after a reversal."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..chain import Form, State
from ..muscle import Array, Muscle, strand_friction
from ..protocol import Rows
from .rig_stage import blocked_top

# --- friction of the strands' contact: f_s ----------------------------------------------------------------


def _strands(power: float, flat: bool) -> Callable[[State, float], None]:
    """f_s x Eq. 2.43; another contact `power` is scaled to the same force at the highest level."""

    def apply(state: State, size: float) -> None:
        m, braid = state.muscle, state.muscle.braid
        if braid is None:
            raise ValueError("strand friction needs the braid")
        top = np.array([state.rows.setpoint.max()])
        start = np.zeros(1)
        scale = float(
            strand_friction(m.geometry, braid, top, start)[0]
            / strand_friction(m.geometry, braid, top, start, power, flat)[0]
        )
        state.frictions.append(
            lambda force, p, gamma: size * scale * strand_friction(m.geometry, braid, p, gamma, power, flat)
        )

    return apply


# --- friction in proportion to the force: K_f -------------------------------------------------------------


def _proportional(state: State, size: float) -> None:
    state.frictions.append(lambda force, p, gamma: size * np.abs(force))


def _sublinear(state: State, size: float) -> None:
    """K_f F1 (|F|/F1)^0.8, F1 half the top blocked force."""
    f1 = 0.5 * blocked_top(state.muscle, state.rows)
    state.frictions.append(lambda force, p, gamma: size * f1 * (np.abs(force) / f1) ** 0.8)


def _pressure_bound(state: State, size: float) -> None:
    """K_f |F| (P/P_max)^0.25."""
    top = float(state.rows.setpoint.max())
    state.frictions.append(lambda force, p, gamma: size * np.abs(force) * (np.maximum(p, 0.0) / top) ** 0.25)


def _offset_proportional(state: State, size: float) -> None:
    """K_f (0.9 |F| + 0.05 F_b): a small seal drag beside it."""
    drag = 0.05 * blocked_top(state.muscle, state.rows)
    state.frictions.append(lambda force, p, gamma: size * (0.9 * np.abs(force) + drag))


# --- speed: share per decade ------------------------------------------------------------------------------


def reference_speed(rows: Rows) -> float:
    """Geometric mean of the test's mean stroke speeds [mm/s]."""
    return float(np.exp(np.mean(np.log(np.unique(rows.nominal_speed)))))


def _rate(kind: str) -> Callable[[State, float], None]:
    def apply(state: State, size: float) -> None:
        rows = state.rows
        v0 = reference_speed(rows)
        # A crosshead that turns gently comes to rest: the law is cut off at 3 % of the stroke's mean speed.
        v = np.maximum(rows.speed, 0.03 * rows.nominal_speed) / v0
        change = {
            "log": size * np.log10(v),
            "power": v ** (size / np.log(10.0)) - 1.0,
            "viscous": size * (np.sqrt(v) - 1.0) / 1.15,
            "stribeck": size * (np.log10(1.0 + v) - 0.3 + 0.35 * np.exp(-3.0 * v)) * 1.6,
        }[kind]
        state.rate = state.rate * (1.0 + change)

    return apply


# --- turning over after a reversal: length [mm] -----------------------------------------------------------


def _turning(kind: str) -> Callable[[State, float], None]:
    """direction x (2 g(d/d_rev) - 1): d is the way since the last reversal, g rises from 0 to 1.

    dahl: (1 - z)^2 hardening of Dahl's equation, solved; slip: elements that yield one after another
    (generalised Maxwell slip with uniformly spread yield lengths); lugre: exponential of a Stribeck bristle.
    """

    def apply(state: State, size: float) -> None:
        if size <= 0.0:
            return
        d = state.rows.since_reversal / size
        g = {
            "exponential": 1.0 - np.exp(-d),
            "tanh": np.tanh(d),
            "dahl": 2.0 * d / (1.0 + 2.0 * d),
            "slip": np.where(d < 3.0, 1.0 - (1.0 - np.minimum(d, 3.0) / 3.0) ** 2, 1.0),
            "lugre": 1.0 - np.exp(-d) * (1.0 - 0.4 * d * np.exp(-0.5 * d)),
        }[kind]
        state.turn = state.turn * (2.0 * g - 1.0)

    return apply


def _reversal_unit(m: Muscle, rows: Rows) -> float:
    return 0.04 * float(rows.stroke.mean())


def _constant(value: float) -> Callable[[Muscle, Rows], float]:
    return lambda m, rows: value


def _form(
    effect: str,
    name: str,
    parameter: str,
    apply: Callable[[State, float], None],
    unit: Callable[[Muscle, Rows], float],
    **more: Any,
) -> Form:
    return Form(effect, name, parameter, "friction", apply, unit, **more)


def _strand_unit(m: Muscle, rows: Rows) -> float:
    """f_s that gives 1.5 % of the top blocked force there, 0.2 where the strands are not declared."""
    if m.braid is None:
        return 0.2
    top = np.array([rows.setpoint.max()])
    return 0.015 * blocked_top(m, rows) / float(strand_friction(m.geometry, m.braid, top, np.zeros(1))[0])


FORMS: tuple[Form, ...] = (
    *(
        _form("strand_friction", name, "f_s", _strands(power, flat), _strand_unit, shared=name == "hertz")
        for name, power, flat in (
            ("hertz", 1 / 3, False),
            ("plastic", 0.0, False),
            ("flat", 1 / 3, True),
            ("soft", 0.15, False),
        )
    ),
    *(
        _form("coulomb_friction", name, "K_f", apply, _constant(0.03), shared=name == "proportional")
        for name, apply in (
            ("proportional", _proportional),
            ("sublinear", _sublinear),
            ("pressure_bound", _pressure_bound),
            ("drag", _offset_proportional),
        )
    ),
    *(
        _form("rate_friction", name, "rate_per_decade", _rate(name), _constant(0.2), shared=name == "log")
        for name in ("log", "power", "viscous", "stribeck")
    ),
    *(
        _form("presliding", name, "reversal_mm", _turning(name), _reversal_unit, shared=name == "exponential")
        for name in ("exponential", "tanh", "dahl", "slip", "lugre")
    ),
)

__all__ = ["FORMS", "Array", "reference_speed"]
