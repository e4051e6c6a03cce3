"""Strokes under Gaussian noise that is alike in all their bins: the likelihood's costliest part, in one pass.

The remainder's columns do not change from θ to θ but for their amplitude, and along a single stroke they
are combinations of a few shapes. So only these shapes pass through the noise's Markov filter, with the
moduli's columns and the residual; the columns' products are put together from the shapes' afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.covariance import Steps, StrokeCovariance
from mpam_calib.posterior.likelihood.markov import Factor, factor, whiten

Array = NDArray[np.float64]

RANK = 1e-13
"""Shapes smaller than this share of a stroke's largest are rounding."""


@dataclass(frozen=True)
class Strokes:
    """``shapes`` (m, w, S) and ``mix`` (S·w, q): the remainder's columns of stroke s are shapes_s · mix_s."""

    layout: StrokeCovariance
    steps: Steps
    shapes: Array
    mix: Array

    @staticmethod
    def build(layout: StrokeCovariance, steps: Steps, remainder: Array | None) -> Strokes:
        """From the remainder's columns (n, q) of all bins, if there are any."""
        strokes, m = layout.pad.shape
        if remainder is None:
            return Strokes(layout, steps, np.zeros((m, 0, strokes)), np.zeros((0, 0)))
        columns = np.where(layout.pad[..., None], 0.0, remainder[layout.index])
        left, size, right = np.linalg.svd(columns, full_matrices=False)
        w = int(np.sum(size > RANK * size[:, :1], axis=1).max())
        mix = size[:, :w, None] * right[:, :w]
        return Strokes(layout, steps, left[:, :, :w].transpose(1, 2, 0).copy(), mix.reshape(strokes * w, -1))

    @property
    def saved(self) -> int:
        """How many fewer shapes there are than columns of the remainder."""
        return int(self.mix.shape[1]) - int(self.shapes.shape[1])

    def factor(self, white: Array, correlated: Array, time: Array, rough: Array) -> Factor:
        """The kinds' covariances (B, K) for sds (N) and a time constant (s) of shape (B,)."""
        return factor(self.layout.parts(self.steps, white, correlated, time, rough))

    def products(self, noise: Factor, bins: Array, amplitude: Array) -> tuple[Array, Array]:
        """Zᵀ C⁻¹ Z (B, p + q + 1, p + q + 1) for Z = [moduli, amplitude · remainder, residual]; ln|C| (B,).

        ``bins`` (p + 1, B, n) are the moduli's columns and the residual, ``amplitude`` (B,) is in N.
        """
        p, B = len(bins) - 1, bins.shape[1]
        m, w, S = self.shapes.shape
        q = self.mix.shape[1]
        whole = np.empty((m, w + p + 1, B, S))
        whole[:, :w] = self.shapes[:, :, None]
        whole[:, w:] = self._placed(bins).transpose(3, 0, 1, 2)
        whiten(noise.take(self.layout.kind), whole)
        # Time last but one, as the library's matrix products want it.
        z = whole.reshape(m * (w + p + 1), B * S).T.copy().reshape(B, S, m, w + p + 1)
        each = np.swapaxes(z, 2, 3) @ z
        result = np.empty((B, p + q + 1, p + q + 1))
        known = each.sum(axis=1)[:, w:, w:]
        result[:, :p, :p], result[:, :p, -1] = known[:, :p, :p], known[:, :p, -1]
        result[:, -1, :p], result[:, -1, -1] = known[:, -1, :p], known[:, -1, -1]
        if q:
            mixed = each[:, :, :w, :w] @ self.mix.reshape(S, w, q)
            own = self.mix.T @ mixed.reshape(B, S * w, q)
            np.multiply(own, (amplitude**2)[:, None, None], out=result[:, p:-1, p:-1])
            cross = self.mix.T @ each[:, :, :w, w:].reshape(B, S * w, p + 1)
            cross *= amplitude[:, None, None]
            result[:, p:-1, :p], result[:, p:-1, -1] = cross[..., :p], cross[..., p]
            result[:, :p, p:-1] = np.swapaxes(cross[..., :p], 1, 2)
            result[:, -1, p:-1] = cross[..., p]
        return result, noise.log_determinant @ np.bincount(self.layout.kind).astype(np.float64)

    def _placed(self, bins: Array) -> Array:
        """Columns (c, B, n) at their places (c, B, S, m), 0 where there is no bin."""
        S, m = self.layout.pad.shape
        if isinstance(self.layout.place, slice):
            return bins.reshape(*bins.shape[:2], S, m)
        return np.where(self.layout.pad, 0.0, bins[:, :, self.layout.index])
