"""Whitening, as cheap as what is tied together allows: strokes of the noise, branches of the remainder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, sparse

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

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
        return np.asarray(own - self._shrunk @ (self.axes.T @ own))

    @cached_property
    def _shrunk(self) -> Array:
        return self.axes * self.shrink

    def scaled(self, scale: float) -> Whitening:
        """The same for scale²·C: built anew, rounding would leave S full."""
        return Whitening(self.apart * (1.0 / scale), self.axes, self.shrink)


@dataclass(frozen=True)
class Axes:
    """A matrix A (n, n) with A·C·Aᵀ = 1 and A·K·Aᵀ = diag(powers) for two covariances C and K.

    ``blocks`` are the rows (m,), and the axes (m, m), of those that neither of them ties to others, such as
    the two branches; ``log_det`` is ln|C|.
    """

    blocks: tuple[tuple[Ints, Array], ...]
    powers: Array
    log_det: float

    @classmethod
    def build(cls, covariance: Array, kernel: Array) -> Axes:
        """From C and K (n, n); raises ``numpy.linalg.LinAlgError`` where C is no covariance."""
        tied = sparse.csr_array((covariance != 0.0) | (kernel != 0.0))
        count, label = sparse.csgraph.connected_components(tied, directed=False)
        blocks, powers, log_det = [], np.empty(len(covariance)), 0.0
        for rows in (np.flatnonzero(label == k) for k in range(count)):
            own = np.ix_(rows, rows)
            root = np.asarray(linalg.cholesky(covariance[own], lower=True))
            half = linalg.solve_triangular(root, kernel[own], lower=True)
            whitened = linalg.solve_triangular(root, half.T, lower=True)
            found, turns = linalg.eigh(0.5 * (whitened + whitened.T))
            axes = linalg.solve_triangular(root, turns, lower=True, trans="T").T
            blocks.append((rows, np.ascontiguousarray(axes)))
            powers[rows] = np.maximum(found, 0.0)
            log_det += 2.0 * float(np.sum(np.log(np.diagonal(root))))
        return cls(tuple(blocks), powers, log_det)

    def __len__(self) -> int:
        return len(self.powers)

    def __matmul__(self, columns: Array) -> Array:
        """A·columns, (n, ...)."""
        if len(self.blocks) == 1:
            return np.asarray(self.blocks[0][1] @ columns)
        result = np.empty(columns.shape)
        for rows, axes in self.blocks:
            result[rows] = axes @ columns[rows]
        return result

    def scaled(self, scale: float) -> Axes:
        """The same for scale²·C."""
        blocks = tuple((rows, axes / scale) for rows, axes in self.blocks)
        log_det = self.log_det + 2.0 * len(self) * float(np.log(scale))
        return Axes(blocks, self.powers / scale**2, log_det)
