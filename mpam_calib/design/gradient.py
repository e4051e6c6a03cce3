"""Gradients of vectorised functions by central differences in the unit box, one call for all points."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpam_calib.design.problem import Function, Problem

Array = NDArray[np.float64]

STEP = 1e-5
"""Step in the unit box; the error is about STEP² of the third derivative (1e-10)."""


def in_box(problem: Problem, function: Function) -> Callable[[Array], Array]:
    """The function of scaled designs u."""
    return lambda u: function(problem.unscaled(u))


def gradient(function: Callable[[Array], Array], u: Array) -> Array:
    """Gradient of ``function`` at the scaled design u, shape (variables,)."""
    steps = STEP * np.eye(u.size)
    values = function(np.concatenate([u + steps, u - steps]))
    slopes: Array = (values[: u.size] - values[u.size :]) / (2.0 * STEP)
    return slopes
