"""Law shape: E_k(P) bends otherwise than the declared law."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import special

from mpam_calib.model.bend import place_in_pressure
from mpam_calib.model.curves import middle_pressure, power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]

TERMS = 6
"""Polynomials beyond the law's, as far as there are levels."""
SD = 0.3
"""Prior scale of the lowest; the n-th is smaller by n^1.5: laws of pressure are smooth."""

LEVEL = "law_bend_0"
SERIES = 8
"""Polynomials that stand for an exponential beyond the law."""


def _degrees(setting: Setting) -> range:
    """Degrees in pressure that the declared law does not already hold."""
    first = 1 if setting.simulation.law == "constant" else 2
    return range(first, min(first + TERMS, len(setting.levels)))


def _level(setting: Setting) -> tuple[Parameter, ...]:
    """A tensile test says what the moduli are without pressure, and nothing of their mean under it."""
    if setting.simulation.moduli == "loops" or not _degrees(setting):
        return ()
    return (Parameter(LEVEL, LongTailed(SD), "what the moduli are more on average than declared", "", ""),)


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    bends = tuple(
        Parameter(f"law_bend_{j}", LongTailed(SD / number**1.5), f"part of degree {j} in pressure", "", "")
        for number, j in enumerate(_degrees(setting), start=1)
    )
    return (*bends, *_level(setting))


def _apply(state: State, values: Values, setting: Setting) -> State:
    x = place_in_pressure(state, setting)
    gain: Array = 1.0 + values.get(LEVEL, np.zeros((1, 1)))
    for j in _degrees(setting):
        gain = gain + values[f"law_bend_{j}"] * legendre.legval(x, [0.0] * j + [1.0])
    return state._replace(wall_gain=state.wall_gain * gain)


def _exponential(state: State, values: Values, setting: Setting) -> State:
    """What an exponential of the pressure has beyond the law: ever steeper (above 0) or levelling off."""
    if not (degrees := _degrees(setting)):
        return state
    first, rate = degrees[0], np.clip(values["law_curvature"], -10.0, 10.0)
    x = np.clip(place_in_pressure(state, setting), -1.5, 1.5)
    # exp(κx) = Σ (2j + 1) i_j(κ) P_j(x), over its first part beyond the law, which κ = 0 leaves alone.
    part, curve = np.ones((1, 1)), np.zeros((1, 1))
    for j in range(first, first + SERIES):
        share = special.hyp0f1(j + 1.5, 0.25 * rate**2) / special.hyp0f1(first + 1.5, 0.25 * rate**2)
        curve = curve + part * share * legendre.legval(x, [0.0] * j + [1.0])
        part = part * rate / (2 * j + 1)
    gain = 1.0 + values.get(LEVEL, np.zeros((1, 1))) + values[f"law_bend_{first}"] * curve
    return state._replace(wall_gain=state.wall_gain * gain)


def _curvature(setting: Setting) -> tuple[Parameter, ...]:
    if not _degrees(setting):
        return ()
    curvature = Parameter(
        "law_curvature", Normal(0.0, 1.5), "exponent over half the range of pressure", "", ""
    )
    return (*_level(setting), curvature)


def _power(state: State, values: Values, setting: Setting) -> State:
    """As declared at no pressure, and from there on more by a power of the pressure."""
    if not (degrees := _degrees(setting)):
        return state
    part = power(state.readings.pressure / middle_pressure(setting), values["law_exponent"])
    return state._replace(wall_gain=state.wall_gain * (1.0 + values[f"law_bend_{degrees[0]}"] * part))


def _line(state: State, values: Values, setting: Setting) -> State:
    """In proportion to the pressure."""
    return _power(state, {**values, "law_exponent": np.ones((1, 1))}, setting)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    if not _degrees(setting):
        return ()
    return (Parameter("law_exponent", LogNormal(1.2, 0.6), "power of the pressure", "textbook", ""),)


register(
    Effect(
        id="law_shape",
        stage=Stage.HISTORY,
        title="Law shape",
        sentence="the bladder's moduli change with pressure otherwise than the declared law",
        told_by="loops at more pressure levels",
        source="bladder stress × (1 + Σ bend_j·Legendre polynomials in pressure beyond the law's)",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={"exponential": _exponential, "power": _power, "line": _line},
        own={"exponential": _curvature, "power": _exponent},
        leading={"exponential": 1, "power": 1, "line": 1},
        sources={
            "exponential": "a + b·P + c·exp(dP): thesis Eq. 4.8, saturating or growing",
            "power": "textbook: E_k·(1 + c·P^m), quadratic, a root or between",
            "line": "E_k·(1 + c·P), as the thesis's linear law of pressure but for all moduli alike",
        },
        bends={"contraction": 2},
    )
)
