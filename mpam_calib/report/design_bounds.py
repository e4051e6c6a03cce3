"""Bounds of the search for designs in words: what they are, what lies at them, what lies outside."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mpam_calib.design.blocked import volume_ratio
from mpam_calib.design.problem import RATIO_LOW, WALL, Variable
from mpam_calib.specimen.declaration import Geometry

ENDS = {" at its upper bound": "↑", " at its lower bound": "↓"}
"""How the searches name an end, and its mark in a table."""
RATIO, RATIO_MARK = "V_bl/V", "†"
"""The constraint that keeps a wall from being thinner: it marks the wall's thickness."""
HAIR = 1e-9
"""Share of a bound's range by which rounding may pass it."""
MOST = 10
"""Digits of a value at most."""


def _span(variable: Variable) -> str:
    low, high = variable.lower / variable.scale, variable.upper / variable.scale
    return f"{low:.3g}–{high:.3g}{_unit(variable)}"


def _unit(variable: Variable) -> str:
    return "°" if variable.unit == "°" else f" {variable.unit}"


def within() -> str:
    """The bounds on wall and angle.

    >>> within()
    'R 0.45–3 mm, t 0.16–1.5 mm, α 36–72°, V_bl/V at least 0.4'
    """
    spans = ", ".join(f"{variable.symbol} {_span(variable)}" for variable in WALL)
    return f"{spans}, V_bl/V at least {RATIO_LOW:g}"


def beyond_bounds(geometry: Geometry) -> str:
    """Which values of a muscle lie outside the bounds ("": none)."""
    found = []
    for variable, value in zip(WALL, (geometry.R0, geometry.t0, geometry.alpha0), strict=True):
        hair = HAIR * (variable.upper - variable.lower)
        if not variable.lower - hair <= value <= variable.upper + hair:
            ends = variable.lower / variable.scale, variable.upper / variable.scale
            found.append(f"{variable.symbol} = {_apart(value / variable.scale, 4, *ends)}{_unit(variable)}")
    ratio = float(volume_ratio(np.array(geometry.R0), np.array(geometry.t0)))
    if ratio < RATIO_LOW - HAIR:
        found.append(f"V_bl/V = {_apart(ratio, 2, RATIO_LOW)}")
    return ", ".join(found)


def _apart(value: float, digits: int, *ends: float) -> str:
    """A value that lies outside a bound, with digits enough to see that it does."""
    while digits < MOST and float(f"{value:.{digits}g}") in [float(f"{end:.{digits}g}") for end in ends]:
        digits += 1
    return f"{value:.{digits}g}"


def marks(held_by: Sequence[str]) -> dict[str, str]:
    """The marks of what holds a design back, by the symbol of the value that each stands behind.

    >>> marks(["R at its upper bound", "V_bl/V >= low"])
    {'R': '↑', 't': '†'}
    """
    found: dict[str, str] = {}
    for name in held_by:
        if name.startswith(RATIO):
            found["t"] = found.get("t", "") + RATIO_MARK
        for words, mark in ENDS.items():
            if name.endswith(words):
                symbol = name.removesuffix(words)
                found[symbol] = found.get(symbol, "") + mark
    return found
