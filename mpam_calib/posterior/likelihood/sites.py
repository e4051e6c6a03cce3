"""Student-t noise in a Gaussian world: one Gaussian site stands for each row's heavy-tailed density.

With z the noise of a row over its scale, −ln t_ν(z) is replaced by (z − shift)²/(2 spread), which has its
slope and its curvature where the noise (in newtons) is that of the mode. Where t's curvature is negative
(rows in its tails) it is LEAST instead, and what all rows lack then is taken from all alike, so that their
sum is right. So everything stays linear and Gaussian given θ.

The value is then put right: at each θ the sites' density of z, at the z that the sites lead to, is replaced
by t_ν's own. This is Laplace's approximation in η, in the strokes' own remainder and in the correlated
noise, with one Newton step from the mode and the curvature there. It is exact for ν → ∞; else its error
grows with what a single row weighs in the fit. Only the white part of a bin's mean (or of a point) is
Student-t. The scatter inside bins has another remedy: chunks far above those of similar force are left out.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage, special, stats

from mpam_calib.posterior.likelihood.algebra import LOG_2PI, cholesky, log_determinant

Array = NDArray[np.float64]

LEAST = 0.02
"""Smallest curvature of a site: a fiftieth of a Gaussian row's."""
LEAST_SHARE = 0.3
"""Smallest share of the positive curvatures that the negative ones may leave."""
COMPARABLE = 1e13
"""A sum of squares of this size is known to a hundredth of a nat."""
NEIGHBOURS = 41
"""Chunks of about the same force, among which one is judged."""
RARE = 1e-5
"""Share of clean chunks that may be left out ..."""
FAR = 4.0
"""... which have at least this multiple of the typical power (correlated noise scatters more)."""


class Sites(NamedTuple):
    """Gaussian stand-ins for rows (B, n), in units of each row's scale (and its square)."""

    spread: Array
    shift: Array

    @staticmethod
    def at(noise: Array | None, scale: Array, dof: Array | None) -> Sites:
        """Sites of rows with this noise (n,) at the mode, scales (B, n) and degrees of freedom (B,).

        Gaussian ones where the noise is Gaussian, or not known yet.
        """
        if noise is None or dof is None:
            return Sites(np.ones_like(scale), np.zeros_like(scale))
        return Sites.settle(noise / scale, dof[:, None])

    @staticmethod
    def settle(z: Array, dof: Array | float) -> Sites:
        """The sites that touch t_ν where the noise is z scales."""
        slope = (dof + 1.0) * z / (dof + z**2)
        bend = (dof + 1.0) * (dof - z**2) / (dof + z**2) ** 2
        kept = np.maximum(bend, LEAST)
        share = bend.sum(axis=-1, keepdims=True) / kept.sum(axis=-1, keepdims=True)
        spread = 1.0 / (kept * np.clip(share, LEAST_SHARE, 1.0))
        return Sites(spread, z - spread * slope)

    def take(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Sites:
        """Sites of some rows."""
        return Sites(self.spread[:, rows], self.shift[:, rows])


class FreeRows(NamedTuple):
    """Rows under sites: C⁻¹A (B, n, k) and C⁻¹r (B, n) of the Gaussian system, scales and sites (B, n)."""

    design: Array
    residual: Array
    scale: Array
    sites: Sites

    def noise(self, eta: Array) -> Array:
        """z (B, n): each row's noise over its scale, given η (B, k), all else at its conditional mean."""
        force = self.residual - np.einsum("bnk,bk->bn", self.design, eta)
        return np.asarray(self.sites.shift + self.sites.spread * self.scale * force)

    def correction(self, eta: Array, dof: Array) -> Array:
        """Σ ln t_ν(z) − ln N(z; shift, spread), (B,), for degrees of freedom (B,).

        −∞ where rounding would decide: at a scale far below every residual the Gaussian system's own density
        is what two huge squares, before and after its coordinates take their part, leave of each other.
        """
        z, v = self.noise(eta), dof[:, None]
        peak = special.gammaln((v + 1.0) / 2.0) - special.gammaln(v / 2.0) - 0.5 * np.log(np.pi * v)
        free = peak - 0.5 * (v + 1.0) * np.log1p(z**2 / v)
        spread, shift = self.sites
        site = -0.5 * ((z - shift) ** 2 / spread + np.log(spread) + LOG_2PI)
        before = np.sum(spread * (self.scale * self.residual) ** 2, axis=1)
        return np.where(before < COMPARABLE, np.sum(free - site, axis=1), -np.inf)


def usual_chunks(chunks: Array, force: Array) -> NDArray[np.bool_]:
    """Which chunks (c, dof) of fast residuals are not far above those at similar forces (c,)."""
    power = np.mean(chunks**2, axis=1)
    order = np.argsort(np.abs(force), kind="stable")
    typical = np.empty_like(power)
    typical[order] = ndimage.median_filter(power[order], size=min(NEIGHBOURS, len(power)), mode="reflect")
    dof = chunks.shape[1]
    limit = max(FAR, float(stats.chi2.isf(RARE, dof) / stats.chi2.median(dof)))
    return np.asarray(power <= limit * typical)


def chunk_log_likelihood(covariance: Array, chunks: Array, grown: Array) -> Array:
    """Log-likelihood (B,) of chunks (c, dof) under covariances (B, dof, dof) times grown² (B or 1, c)."""
    factor = cholesky(covariance)
    white = np.linalg.solve(factor, np.broadcast_to(chunks.T, (len(factor), *chunks.T.shape)))
    squares = np.sum(np.sum(white**2, axis=1) / grown**2, axis=1)
    dof = chunks.shape[1]
    growth = 2.0 * dof * np.sum(np.log(np.broadcast_to(grown, (len(factor), len(chunks)))), axis=1)
    result: Array = -0.5 * (len(chunks) * (log_determinant(factor) + dof * LOG_2PI) + growth + squares)
    return result
