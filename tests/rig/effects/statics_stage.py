"""Effects on the static force: pressure in the wall, bends of E_k(P), stress of higher order."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..chain import Form, State
from ..muscle import PA, Array, Muscle, Shape, shape_of, strains
from ..protocol import Rows

# --- wall pressure: the thickness term times 1 - factor ----------------------------------------------------


def _uniform(state: State, size: float) -> None:
    state.thickness.append(lambda s, p: np.full_like(p, 1.0 - size))


def _lame(state: State, size: float) -> None:
    """Twice the mean pressure through an elastic thick wall (Lame) as a share of P; 1 for a thin one."""

    def factor(s: Shape, p: Array) -> Array:
        inner, outer = (s.R - s.t) ** 2, s.R**2
        mean = inner / (outer - inner) * (outer * np.log(outer / inner) / (outer - inner) - 1.0)
        return 1.0 - size * 2.0 * mean

    state.thickness.append(factor)


def _seating(state: State, size: float) -> None:
    """The liner seats as the pressure rises: factor tanh(2 P / P_max)."""
    top = float(state.rows.setpoint.max())
    state.thickness.append(lambda s, p: 1.0 - size * np.tanh(2.0 * p / top))


def _thinning(state: State, size: float) -> None:
    """The share carried follows the wall's thinning: factor (t/t0)^0.5."""
    t0 = state.muscle.geometry.t0_mm
    state.thickness.append(lambda s, p: 1.0 - size * np.sqrt(s.t / t0))


# --- law shape: E_k(P) times 1 + size x bend ---------------------------------------------------------------


def _bends(kind: str) -> Callable[[State, float], None]:
    def apply(state: State, size: float) -> None:
        levels = state.rows.setpoint
        low, top = float(levels.min()), float(levels.max())
        middle, half = 0.5 * (low + top), max(0.5 * (top - low), 1e-9)

        def bend(p: Array) -> Array:
            v = (p - middle) / half
            shape = {
                "quadratic": v**2 - 0.5,
                "saturating": 1.5 - 2.0 * np.exp(-3.0 * np.maximum(p, 0.0) / top) - 0.5,
                "power": np.sqrt(np.maximum(p, 0.0) / top) - 0.5,
                "knee": np.maximum(v + 0.2, 0.0),
                "sigmoid": np.tanh(2.5 * v),
            }[kind]
            return np.maximum(1.0 + size * shape, 0.02)

        state.bends.append(bend)

    return apply


def _quarter(m: Muscle, rows: Rows) -> float:
    return 0.25


# --- order too low: stress added to the wall ---------------------------------------------------------------


def _hoop_reference(state: State) -> tuple[float, float]:
    """Largest hoop strain over the stroke and the wall's polynomial stress [N/mm2] there."""
    m, rows = state.muscle, state.rows
    length = np.array([m.geometry.L0_mm - rows.displacement.max()])
    _, x = strains(m.geometry, shape_of(m.geometry, length, m.simulation.kinematics), m.simulation.strain)
    top = np.array([rows.setpoint.max()])
    E = m.simulation.law.moduli(top, top)[:, 0]
    stress = PA * float(sum(e * x[0] ** (k + 1) for k, e in enumerate(E)))
    return float(x[0]), abs(stress)


def _extra(kind: str) -> Callable[[State, float], None]:
    """Extra stress that is `size` times the polynomial's at the largest hoop strain e1."""

    def apply(state: State, size: float) -> None:
        e1, stress = _hoop_reference(state)
        order = state.muscle.simulation.law.order
        scale = size * stress

        def added(e: Array, p: Array) -> Array:
            u = e / e1
            if kind == "next":
                return scale * u ** (order + 1)
            if kind == "second_next":
                return scale * u ** (order + 2)
            if kind == "exponential":  # Fung-like, with its first terms left to the polynomial
                return scale * (np.exp(3.0 * u) - 1.0 - 3.0 * u - 4.5 * u**2) / (np.exp(3.0) - 8.5)
            return scale * 0.36 * u**3 / np.maximum(1.0 - 0.64 * u**2, 0.05)  # Gent-like limit of the chains

        state.stresses.append(added)

    return apply


def _half(m: Muscle, rows: Rows) -> float:
    return 0.5


def _form(
    effect: str,
    name: str,
    parameter: str,
    apply: Callable[[State, float], None],
    unit: Callable[[Muscle, Rows], float],
    **more: Any,
) -> Form:
    return Form(effect, name, parameter, "statics", apply, unit, **more)


FORMS: tuple[Form, ...] = (
    *(
        _form("wall_pressure", name, "wall_factor", apply, _half, high=2.4, shared=name == "uniform")
        for name, apply in (
            ("uniform", _uniform),
            ("lame", _lame),
            ("seating", _seating),
            ("thinning", _thinning),
        )
    ),
    *(
        _form(
            "law_shape", name, "", _bends(name), _quarter, high=3.5, signed=True, shared=name == "quadratic"
        )
        for name in ("quadratic", "saturating", "power", "knee", "sigmoid")
    ),
    *(
        _form("order_too_low", name, "", _extra(name), _half, high=4.0, shared=name == "next")
        for name in ("next", "second_next", "exponential", "gent")
    ),
)
