"""The fast scatter inside bins: chunks of consecutive rows without their polynomials hold the noise alone.

Their likelihood under white and AR(1) noise is reckoned from the covariance of what is left of a chunk, or by
the same pass along time as that of the bins.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.algebra import LOG_2PI, cholesky, inverse, log_determinant
from mpam_calib.posterior.likelihood.markov import Parts, factor, whiten
from mpam_calib.posterior.likelihood.parting import FINE, Parting
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

CHUNK = 32
"""At most so many consecutive readings of a bin tell of the fast noise."""


class Chunks(NamedTuple):
    """What is left of each chunk, c (chunks, dof), N, and the bin (chunks,) that it is from."""

    residuals: Array
    bin: Ints


@dataclass(frozen=True)
class FastScatter:
    """Scatter matrix ``total`` Σ c cᵀ (dof, dof), N², of what is left of so many ``chunks``.

    ``contrast`` (size, dof) takes the polynomial out of a chunk's rows, which are ``dt`` (s) apart.
    """

    total: Array
    chunks: int
    contrast: Array
    dt: float

    def covariance(self, averaged: int, white: Array, correlated: Array, time: Array) -> Array:
        """Covariance (B, dof, dof), N², of what is left of a chunk under white + AR(1) noise.

        Sds (N) and the time constant (s) are (B,); ``averaged`` is how many raw rows each row stands for.
        """
        size = self.contrast.shape[0]
        lags = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))
        covariance = correlated[:, None, None] ** 2 * np.exp(-lags * self.dt / time[:, None, None])
        covariance = covariance + white[:, None, None] ** 2 / averaged * np.eye(size)
        return np.asarray(self.contrast.T @ covariance @ self.contrast)

    def log_likelihood(self, averaged: int, white: Array, correlated: Array, time: Array) -> Array:
        """ln p (B,) of all chunks under white + AR(1) noise; arguments as of :meth:`covariance`."""
        return self.log_likelihood_of(self.covariance(averaged, white, correlated, time))

    def log_likelihood_of(self, covariance: Array) -> Array:
        """ln p (B,) of all chunks, given the covariance (B, dof, dof), N², of each."""
        log_det = log_determinant(cholesky(covariance))
        trace = np.sum(inverse(covariance) * self.total.T, axis=(1, 2))
        result: Array = -0.5 * (self.chunks * (log_det + len(self.total) * np.log(2.0 * np.pi)) + trace)
        return result


def fast_scatter(loops: Loops, parting: Parting, dt: Array) -> tuple[FastScatter, Chunks] | tuple[None, None]:
    """What one chunk of each regular bin tells, ``dt`` (strokes,), s, being the time between rows.

    None where they are too few or too short.
    """
    typical = float(np.median(dt))
    starts, segment, rows = parting.starts, parting.segment, parting.rows
    last = np.append(segment[1:] != segment[:-1], True)
    # Bins next to a turn are left out: there the force itself is fast.
    usable = (parting.position >= len(FINE) + 1) & ~last & (np.abs(dt[segment] / typical - 1.0) < 0.1)
    censored = np.add.reduceat(loops.censored.astype(np.float64), starts) > 0
    usable &= (rows >= 4) & ~censored
    if usable.sum() < 8:
        return None, None
    size = int(min(CHUNK, np.quantile(rows[usable], 0.1)))
    if size < 4:
        return None, None
    usable &= rows >= size
    chunks = loops.force_N[starts[usable][:, None] + np.arange(size)]
    # A parabola, however short the chunk: a slope alone would leave the force's own bend in the noise.
    basis = np.vander(np.linspace(-1.0, 1.0, size), 3)
    full, _ = np.linalg.qr(basis, mode="complete")
    contrast = full[:, 3:]
    residuals = chunks @ contrast
    pooled = FastScatter(residuals.T @ residuals, len(residuals), contrast, typical)
    return pooled, Chunks(residuals, np.flatnonzero(usable))


@dataclass(frozen=True)
class MarkovScatter:
    """The same for the pass along time, where the rows' own covariance can be used, which is Markov.

    The polynomial's coefficients are integrated out under a flat prior (Harville 1974,
    doi:10.1093/biomet/61.2.383). ``columns`` (size, g + r): the polynomials' basis, and a root (N) of the
    chunks' scatter matrix; ``chunks`` is how many there are, ``polynomials`` is g, ``dt`` the time between
    rows (s), ``averaged`` how many raw rows each row stands for.
    """

    columns: Array
    chunks: int
    polynomials: int
    dt: float
    averaged: int

    @staticmethod
    def build(scatter: FastScatter, averaged: int) -> MarkovScatter:
        """From the scatter of the chunks."""
        size, dof = scatter.contrast.shape
        lost = np.linalg.qr(scatter.contrast, mode="complete")[0][:, dof:]
        power, axes = np.linalg.eigh(scatter.total)
        root = scatter.contrast @ (axes * np.sqrt(np.maximum(power, 0.0)))
        columns = np.concatenate([lost, root], axis=1)
        return MarkovScatter(columns, scatter.chunks, size - dof, scatter.dt, averaged)

    def log_likelihood(self, white: Array, correlated: Array, time: Array) -> Array:
        """ln p (B,) of all chunks for sds of the noise (N) and its time constant (s), all (B,)."""
        size, g = len(self.columns), self.polynomials
        shape = (size, 1, len(white))
        onward = np.broadcast_to(np.exp(-self.dt / time), shape).copy()
        onward[-1] = 0.0
        parts = Parts(
            np.broadcast_to(correlated**2 + white**2 / self.averaged, (size, len(white))),
            np.broadcast_to(correlated**2, shape),
            np.ones(shape),
            onward,
        )
        noise = factor(parts)
        columns = np.repeat(self.columns[..., None], len(white), axis=2)
        whiten(noise, columns)
        # Time first was for the pass; the library's matrix products want the batch first.
        z = columns.reshape(-1, len(white)).T.copy().reshape(len(white), size, -1)
        products = np.swapaxes(z[..., :g], 1, 2) @ z
        root = cholesky(products[..., :g])
        fitted = np.linalg.solve(root, products[..., g:])
        squares = np.einsum("bik,bik->b", z[..., g:], z[..., g:]) - np.einsum("bgk,bgk->b", fitted, fitted)
        log_det = noise.log_determinant + log_determinant(root)
        result: Array = -0.5 * (self.chunks * (log_det + (size - g) * LOG_2PI) + squares)
        return result
