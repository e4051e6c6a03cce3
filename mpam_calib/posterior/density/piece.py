"""What one data set adds to the collapsed posterior: products of its columns and residual under its noise."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.algebra import LOG_2PI, cholesky, inverse, log_determinant

Array = NDArray[np.float64]


class Piece(NamedTuple):
    """One data set's share: Aᵀ C⁻¹ A (B, k, k), Aᵀ C⁻¹ r (B, k), rᵀ C⁻¹ r + ln|C| + n ln 2π (B,)."""

    gram: Array
    pull: Array
    constant: Array

    def widened(self, k: int) -> Piece:
        """With coordinates behind its own, k in all, that this data set says nothing about."""
        gram, pull, constant = self
        B, own = pull.shape
        if own == k:
            return self
        wide = Piece(np.zeros((B, k, k)), np.zeros((B, k)), constant)
        wide.gram[:, :own, :own], wide.pull[:, :own] = gram, pull
        return wide


def total(pieces: list[Piece]) -> Piece:
    """The sum of at least one piece; written into the first one's arrays."""
    first, *others = pieces
    gram, pull, constant = first
    for piece in others:
        gram += piece.gram
        pull += piece.pull
        constant = constant + piece.constant
    return Piece(gram, pull, constant)


def white_piece(design: Array, residual: Array, variance: Array) -> Piece:
    """Independent rows: columns (B, n, k), residuals and variances (B, n)."""
    weighted = design / variance[..., None]
    gram = np.swapaxes(design, 1, 2) @ weighted
    pull = np.einsum("bnk,bn->bk", weighted, residual)
    constant = np.sum(residual**2 / variance + np.log(variance) + LOG_2PI, axis=1)
    return Piece(gram, pull, constant)


def segment_piece(
    covariance: Array, kind: NDArray[np.int64], padded: Array, rows: int
) -> tuple[Piece, Array]:
    """Correlated segments: covariance (B, K, m, m), kind (S,), [A r] padded (B, S·m, k + 1); C⁻¹[A r]."""
    B, _, width = padded.shape
    m = covariance.shape[-1]
    log_dets = log_determinant(cholesky(covariance))
    log_det = log_dets @ np.bincount(kind, minlength=covariance.shape[1])
    weighted = (inverse(covariance)[:, kind] @ padded.reshape(B, -1, m, width)).reshape(padded.shape)
    full = np.swapaxes(padded, 1, 2) @ weighted
    piece = Piece(full[:, :-1, :-1], full[:, :-1, -1], full[:, -1, -1] + log_det + rows * LOG_2PI)
    return piece, weighted


def forget(covariance: Array, lost: NDArray[np.bool_]) -> Array:
    """Give lost rows unit variance and no covariance, so that they carry no information."""
    either = lost[:, :, None] | lost[:, None, :]
    eye = np.eye(lost.shape[1])
    return np.where(either, eye * lost[:, :, None], covariance)
