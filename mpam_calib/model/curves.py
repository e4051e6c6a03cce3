"""Curves that several effects share: powers, and what settles, each through a point inside the data.

All take arrays (B, n) and shape parameters (B, 1), and stay finite however odd the shape.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHAPES, SHORTEST, Shape

Array = NDArray[np.float64]

LOWEST, HIGHEST = 0.02, 50.0
"""Ratios between which a power is taken as it is."""
STEEPEST = 8.0
"""Largest exponent, whatever its prior."""


def power(ratio: Array, exponent: Array) -> Array:
    """ratio^exponent, of either sign, for ratios above 0 (below LOWEST they count as LOWEST)."""
    return np.asarray(np.clip(ratio, LOWEST, HIGHEST) ** np.clip(exponent, -STEEPEST, STEEPEST))


def signed_power(ratio: Array, exponent: Array) -> Array:
    """|ratio|^exponent with the ratio's sign, for exponents above 0."""
    return np.asarray(np.sign(ratio) * np.minimum(np.abs(ratio), HIGHEST) ** np.minimum(exponent, STEEPEST))


def box_cox(ratio: Array, exponent: Array) -> Array:
    """(ratio^n − 1)/n: the logarithm at n = 0, a line at 1, something that ends below 0."""
    log = np.log(np.clip(ratio, LOWEST**2, 1e6))
    return np.asarray(log * special.exprel(np.clip(exponent * log, -50.0, 50.0)))


def settled(past: Array, constant: Array, reference: float) -> Array:
    """1 − exp(−past/constant), of a time or of a pressure, over its value at the reference; 0 below 0."""
    # A gauge may read below 0, where the exponential grows without bound.
    return np.asarray(np.expm1(-np.maximum(past, 0.0) / constant) / np.expm1(-reference / constant))


def middle_pressure(setting: Setting) -> float:
    """The middle of the levels' range, Pa."""
    return max(0.5 * (float(setting.levels[0]) + setting.top_pressure), 1.0)


def middle_shape(state: State, setting: Setting) -> Shape:
    """The muscle's shape at half the stroke."""
    length = np.maximum(state.rest.L0 - 0.5 * setting.stroke, SHORTEST * state.rest.L0)
    return SHAPES[state.kinematics](length, state.rest)


def level_stroke(state: State, setting: Setting) -> Array:
    """The stroke (m) of the level of each reading; the longest where levels are not told apart."""
    if setting.strokes is None:
        return np.full((1, 1), setting.stroke)
    strokes = np.where(setting.strokes > 0.0, setting.strokes, setting.stroke)
    return np.asarray(np.interp(state.readings.pressure, setting.levels, strokes))


def over_mean(speed: Array, setting: Setting) -> Array:
    """A speed (m/s) over the test's mean; 1 at rest."""
    return np.where(speed > 0.0, speed / setting.speed, 1.0)


def half_test(setting: Setting) -> float:
    """Half the test's duration, s."""
    return 0.5 * max(setting.duration, 1.0)
