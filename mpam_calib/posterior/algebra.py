"""Batched solves and factors that do not fail as a whole where one matrix is at fault."""

from __future__ import annotations

import contextlib

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def solve(matrix: Array, right: Array) -> Array:
    """x (B, k) of matrix (B, k, k) · x = right (B, k)."""
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], dtype=np.float64)


def cholesky(matrix: Array) -> Array:
    """Cholesky factors; nan for a matrix that rounding has made indefinite (its density counts as 0)."""
    try:
        return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        factor = np.full_like(matrix, np.nan)
        for index in np.ndindex(matrix.shape[:-2]):
            with contextlib.suppress(np.linalg.LinAlgError):
                factor[index] = np.linalg.cholesky(matrix[index])
        return factor


def log_determinant(factor: Array) -> Array:
    """ln|M| (...,) of M = L Lᵀ, from its Cholesky factor L (..., k, k)."""
    result: Array = 2.0 * np.sum(np.log(np.diagonal(factor, axis1=-2, axis2=-1)), axis=-1)
    return result
