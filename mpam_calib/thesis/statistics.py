"""Goodness of fit as the thesis computes it, and as it should be compared; relative least squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def squared_correlation(fitted: Array, observed: Array) -> float:
    """The thesis's R²: the squared correlation, blind to scale and offset."""
    return float(np.corrcoef(fitted, observed)[0, 1] ** 2)


def determination(fitted: Array, observed: Array) -> float:
    """1 − SSE/SST: what R² means where it is to measure a fit."""
    return float(1.0 - np.sum((fitted - observed) ** 2) / np.sum((observed - observed.mean()) ** 2))


def rmse(fitted: Array, observed: Array) -> float:
    """Root mean square of the residuals."""
    return float(np.sqrt(np.mean((fitted - observed) ** 2)))


def least_squares(columns: Array, target: Array, weight: Array | None = None) -> Array:
    """Coefficients of a linear least-squares fit, shape (columns,), columns scaled to unit norm first.

    The polynomial basis of the stretches has condition numbers of 1e4 (order 4) to 7e6 (order 6) even then.
    """
    w = np.ones_like(target) if weight is None else weight
    weighted = columns * w[:, None]
    norm = np.linalg.norm(weighted, axis=0)
    solution: Array = np.linalg.lstsq(weighted / norm, target * w, rcond=1e-15)[0] / norm
    return solution


def scaled_condition(columns: Array) -> float:
    """Condition number of the columns after scaling each to unit norm."""
    return float(np.linalg.cond(columns / np.linalg.norm(columns, axis=0)))
