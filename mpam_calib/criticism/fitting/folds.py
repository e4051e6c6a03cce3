"""Which levels or cycles are left out together, and how probable what was left out turns out to be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

FEWEST = 3
"""Levels or cycles of which one can be left out."""
FOLDS, FEW_FOLDS = 5, 3
MANY = 12
"""Labels from which on few folds leave enough in each: every fold repeats the whole search."""
Z90 = 1.6449
"""Standard deviations either side of a mean that hold 90 % of a Gaussian."""


def folds_of(labels: Labels) -> list[Labels]:
    """Labels (m,), each in the one fold in which it is left out; its neighbours stay there."""
    count = FEW_FOLDS if len(labels) >= MANY else min(FOLDS, len(labels))
    return [labels[i::count] for i in range(count)]


def log_densities(residual: Array, covariance: Array, label: Labels) -> Array:
    """Log density of a residual (h,) under N(0, covariance), parted by the label (h,) of its rows: (labels,).

    Each row counts given those before it. So the parts make up the joint density, and what two labels are
    both off by counts once: their scatter says how sure the sum is.
    """
    lower = linalg.cholesky(covariance, lower=True)
    z = linalg.solve_triangular(lower, residual, lower=True)
    each = -0.5 * (z**2 + np.log(2.0 * np.pi)) - np.log(np.diagonal(lower))
    return np.array([each[label == one].sum() for one in np.unique(label)])


def total(parts: Array) -> tuple[float, float]:
    """Sum of the parts (m,) of levels or cycles, and its standard error."""
    return float(np.sum(parts)), float(np.sqrt(len(parts)) * np.std(parts, ddof=1))
