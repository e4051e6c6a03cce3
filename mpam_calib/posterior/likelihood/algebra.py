"""Batched solves and factors that do not fail as a whole where one matrix is at fault."""

from __future__ import annotations

import contextlib
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOG_2PI = float(np.log(2.0 * np.pi))


def solve(matrix: Array, right: Array) -> Array:
    """x (B, k) of matrix (B, k, k) · x = right (B, k); nan where the matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], dtype=np.float64)
    except np.linalg.LinAlgError:
        return np.asarray((inverse(matrix) @ right[..., None])[..., 0], dtype=np.float64)


def cholesky(matrix: Array) -> Array:
    """Cholesky factors; nan for a matrix that rounding has made indefinite (its density counts as 0)."""
    return _each(np.linalg.cholesky, matrix)


def inverse(matrix: Array) -> Array:
    """Inverses; nan for a matrix that is singular to rounding (its density counts as 0)."""
    return _each(np.linalg.inv, matrix)


def _each(function: Callable[..., Array], matrix: Array) -> Array:
    """The function of all matrices (..., k, k) at once, or of one after the other where some are at fault."""
    try:
        return np.asarray(function(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        result = np.full_like(matrix, np.nan)
        for index in np.ndindex(matrix.shape[:-2]):
            with contextlib.suppress(np.linalg.LinAlgError):
                result[index] = function(matrix[index])
        return result


def log_determinant(factor: Array) -> Array:
    """ln|M| (...,) of M = L Lᵀ, from its Cholesky factor L (..., k, k)."""
    result: Array = 2.0 * np.sum(np.log(np.diagonal(factor, axis1=-2, axis2=-1)), axis=-1)
    return result


def condense(matrix: Array, right: Array) -> tuple[Array, Array]:
    """Cholesky factors L of matrices M (B, k, k) and L⁻¹ right (B, k), from one factorisation; for M ≥ 1."""
    B, k, _ = matrix.shape
    bordered = np.empty((B, k + 1, k + 1))
    bordered[:, :k, :k] = matrix
    bordered[:, k, :k] = bordered[:, :k, k] = right
    # The corner must only exceed rightᵀ M⁻¹ right.
    bordered[:, k, k] = 1.0 + 2.0 * np.sum(right**2, axis=1)
    factor = cholesky(bordered)
    return factor[:, :k, :k], factor[:, k, :k]


def solve_transposed(factor: Array, right: Array) -> Array:
    """L⁻ᵀ right (B, k) for Cholesky factors L (B, k, k)."""
    return solve(np.swapaxes(factor, 1, 2), right)
