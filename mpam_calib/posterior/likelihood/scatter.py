"""The fast scatter inside bins under white and AR(1) noise, by the same pass along time as the bins.

The chunks' residuals are free of a polynomial each. Their likelihood is that of the chunks themselves with
the polynomial's coefficients integrated out under a flat prior (Harville 1974, doi:10.1093/biomet/61.2.383),
so that the rows' own covariance can be used, which is Markov.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.algebra import LOG_2PI, cholesky, log_determinant
from mpam_calib.posterior.likelihood.markov import Parts, factor, whiten

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scatter:
    """``columns`` (size, g + r): the polynomials' basis, and a root (N) of the chunks' scatter matrix.

    ``chunks`` is how many there are, ``polynomials`` is g, ``dt`` the time between rows (s), ``averaged``
    how many raw rows each row stands for.
    """

    columns: Array
    chunks: int
    polynomials: int
    dt: float
    averaged: int

    @staticmethod
    def build(scatter: tuple[Array, int, Array, float], averaged: int) -> Scatter:
        """From what :class:`mpam_calib.posterior.likelihood.bins.LoopBins` keeps."""
        total, chunks, contrast, dt = scatter
        size, dof = contrast.shape
        lost = np.linalg.qr(contrast, mode="complete")[0][:, dof:]
        power, axes = np.linalg.eigh(total)
        root = contrast @ (axes * np.sqrt(np.maximum(power, 0.0)))
        return Scatter(np.concatenate([lost, root], axis=1), chunks, size - dof, dt, averaged)

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
