"""Whitening by strokes, and by what ties them together: as cheap as if they were apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

Array = NDArray[np.float64]

SPARSE = 0.1
"""Share of a factor's entries below which it is worth leaving the others out."""


@dataclass(frozen=True)
class Whitening:
    """A matrix W (n, n) with W·C·Wᵀ = 1 for a covariance C = S + T·Tᵀ, as (1 − Z·diag(shrink)·Zᵀ)·L⁻¹.

    L is the Cholesky factor of S (strokes apart), Z (n, r) the axes of the few ties in L⁻¹·T.
    """

    apart: sparse.csr_array | Array
    axes: Array
    shrink: Array

    @classmethod
    def build(cls, covariance: Array, tied: Array) -> Whitening:
        """From C (n, n) and T (n, r); raises ``numpy.linalg.LinAlgError`` where S is no covariance."""
        factor = linalg.cholesky(covariance - tied @ tied.T, lower=True)
        inverse = linalg.solve_triangular(factor, np.eye(len(factor)), lower=True)
        thin = np.mean(np.abs(inverse) > 0.0) < SPARSE
        axes, sizes, _ = linalg.svd(inverse @ tied, full_matrices=False)
        return cls(
            sparse.csr_array(inverse) if thin else np.ascontiguousarray(inverse),
            axes,
            1.0 - 1.0 / np.sqrt(1.0 + sizes**2),
        )

    def __len__(self) -> int:
        return len(self.axes)

    def __matmul__(self, columns: Array) -> Array:
        """W·columns, (n, ...)."""
        own = np.asarray(self.apart @ columns)
        return np.asarray(own - (self.axes * self.shrink) @ (self.axes.T @ own))
