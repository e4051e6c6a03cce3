"""Covariance of bin means along a stroke: white noise, correlated noise, the stroke's own remainder."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.bins import LoopBins

Array = NDArray[np.float64]

ROUGH_LENGTH = 1.0 / 6.0
"""Correlation length of a stroke's own remainder, as a share of the stroke."""


@dataclass(frozen=True)
class StrokeCovariance:
    """Padded (segments S, width m) layout of the bins and what their covariance is made of.

    ``white`` (S, m) is 1/rows; ``rough`` (S, m, m) the exponential kernel in displacement; ``rows``
    (S, m) the numbers of rows; ``lag`` (S, m, m) rows between the end of one bin and the start of a
    later one; ``pad`` (S, m) marks the padding.
    """

    white: Array
    rough: Array
    rows: Array
    lag: Array
    dt: Array
    pad: NDArray[np.bool_]
    index: NDArray[np.int64]

    @staticmethod
    def build(bins: LoopBins) -> StrokeCovariance:
        """The layout of a set of bins."""
        shape = (bins.segments, bins.width)
        index = np.full(shape, -1)
        index[bins.segment, bins.position] = np.arange(len(bins))
        pad = index < 0
        x = bins.middle().displacement[index]
        rows = np.where(pad, 1.0, bins.count[index])
        distance = np.abs(x[:, :, None] - x[:, None, :]) / bins.contraction_scale
        rough = np.exp(-distance / ROUGH_LENGTH)
        start, stop = bins.start[index], bins.stop[index]
        gap = (start[:, None, :] - stop[:, :, None]) / bins.dt[:, None, None]
        lag = np.maximum(np.triu(np.where(np.isfinite(gap), gap, 0.0), 1), 0.0)
        both = pad[:, :, None] | pad[:, None, :]
        rough[both] = 0.0
        return StrokeCovariance(
            np.where(pad, 0.0, 1.0 / rows) / bins.averaged, rough, rows, lag, bins.dt, pad, index
        )

    def matrix(self, white: Array, correlated: Array, time: Array, rough: Array) -> Array:
        """Covariance (B, S, m, m), N², for sds and time constant of shape (B,); padding has variance 1.

        The correlated part is AR(1) between rows: cov of two bin means is
        σ² ρ^lag (1 − ρ^n)(1 − ρ^n′) / (n n′ (1 − ρ)²).
        """
        B = len(white)
        S, m = self.pad.shape
        result = rough[:, None, None, None] ** 2 * self.rough
        diagonal = white[:, None, None] ** 2 * self.white
        if np.any(correlated > 0.0):
            log_rho = -self.dt / time[:, None]
            rho = np.exp(log_rho)[:, :, None]
            n = self.rows
            series = -np.expm1(n * log_rho[:, :, None]) / (1.0 - rho)
            mean = series / n
            cross = np.exp(self.lag * log_rho[:, :, None, None]) * mean[:, :, :, None] * mean[:, :, None, :]
            cross = np.triu(cross, 1)
            own = (n * (1.0 + rho) / (1.0 - rho) - 2.0 * rho * series / (1.0 - rho)) / n**2
            variance = correlated[:, None, None, None] ** 2
            both = self.pad[:, :, None] | self.pad[:, None, :]
            result = result + np.where(both, 0.0, variance * (cross + np.swapaxes(cross, 2, 3)))
            diagonal = diagonal + np.where(self.pad, 0.0, variance[..., 0] * own)
        diagonal = np.where(self.pad, 1.0, diagonal)
        result = np.broadcast_to(result, (B, S, m, m)).copy()
        result[:, :, np.arange(m), np.arange(m)] += diagonal
        return result


def fast_noise_log_likelihood(
    scatter: tuple[Array, int, Array, float], averaged: int, white: Array, correlated: Array, time: Array
) -> Array:
    """Log-likelihood (B,) of the scatter inside bins under white + AR(1) noise."""
    total, chunks, contrast, dt = scatter
    size = contrast.shape[0]
    lags = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
    covariance = correlated[:, None, None] ** 2 * np.exp(-lags * dt / time[:, None, None])
    covariance = covariance + white[:, None, None] ** 2 / averaged * np.eye(size)
    projected = contrast.T @ covariance @ contrast
    factor = np.linalg.cholesky(projected)
    log_det = 2.0 * np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    trace = np.trace(np.linalg.solve(projected, total[None]), axis1=1, axis2=2)
    dof = contrast.shape[1]
    result: Array = -0.5 * (chunks * (log_det + dof * np.log(2.0 * np.pi)) + trace)
    return result
