"""Law shape: E_k(P) bends otherwise than the declared law."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]

TERMS = 6
"""Polynomials beyond the law's, as far as there are levels."""
SD = 0.3
"""Prior scale of the lowest; the n-th is smaller by n^1.5: laws of pressure are smooth."""


def _degrees(setting: Setting) -> range:
    """Degrees in pressure that the declared law does not already hold."""
    first = 1 if setting.simulation.law == "constant" else 2
    return range(first, min(first + TERMS, len(setting.levels)))


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return tuple(
        Parameter(f"law_bend_{j}", LongTailed(SD / number**1.5), f"part of degree {j} in pressure", "", "")
        for number, j in enumerate(_degrees(setting), start=1)
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    low, high = float(setting.levels[0]), setting.top_pressure
    x = (2.0 * state.readings.pressure - low - high) / max(high - low, 1.0)
    gain: Array = np.ones((1, 1))
    for j in _degrees(setting):
        gain = gain + values[f"law_bend_{j}"] * legendre.legval(x, [0.0] * j + [1.0])
    return replace(state, wall_gain=state.wall_gain * gain)


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
        bends={"contraction": 2},
    )
)
