"""The collapsed posterior: everything the force is linear in is integrated out exactly.

y = f(θ) + A(θ) η + ε, η ~ N(0, I), ε ~ N(0, C(θ)), so with S = I + Aᵀ C⁻¹ A and h = Aᵀ C⁻¹ (y − f)
    ln p(y | θ) = −½ [(y − f)ᵀ C⁻¹ (y − f) − hᵀ S⁻¹ h + ln|C| + ln|S| + n ln 2π],
    η | θ, y ~ N(S⁻¹ h, S⁻¹).
Slack rows enter through the probability of being slack and a Laplace approximation in η
(:mod:`mpam_calib.posterior.density.slack`), Student-t noise through one Gaussian site for each row
(:mod:`mpam_calib.posterior.likelihood.sites`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.noise import FREEDOM
from mpam_calib.posterior.density.added import Added, Values
from mpam_calib.posterior.density.bin_share import BinShare
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.piece import total
from mpam_calib.posterior.density.point_share import PointShare
from mpam_calib.posterior.density.slack import with_slack
from mpam_calib.posterior.density.tensile_piece import tensile_piece
from mpam_calib.posterior.likelihood.algebra import (
    LOG_2PI,
    condense,
    inverse,
    log_determinant,
    solve_transposed,
)
from mpam_calib.posterior.likelihood.bins import LoopBins
from mpam_calib.posterior.likelihood.points import Points
from mpam_calib.posterior.likelihood.tensile_points import TensilePoints

KNOWN = 1e9
"""Precision's root of coordinates that are given."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Data:
    """What a posterior is conditioned on; any part may be None. ``floor`` in N."""

    bins: LoopBins | None
    points: Points | None
    tensile: TensilePoints | None
    floor: float = 0.0


@dataclass(frozen=True)
class Collapsed:
    """ln p(y | θ) for many θ at once, and exact draws of the linear coordinates."""

    model: Model
    data: Data
    guide: Guide

    @cached_property
    def _bins(self) -> BinShare | None:
        bins = self.data.bins
        return None if bins is None else BinShare(self.model, bins, self.guide, self.data.floor)

    @cached_property
    def _points(self) -> PointShare | None:
        points = self.data.points
        return None if points is None else PointShare(self.model, points, self.guide, self.data.floor)

    @property
    def white_only(self) -> bool:
        """Whether all rows of loops count by themselves, their noise being white and of one size."""
        return self._bins is not None and self._bins.white_only

    @property
    def cells(self) -> int:
        """Readings × columns that one θ takes in memory."""
        points, tensile = self.data.points, self.data.tensile
        parts = (self.data.bins, points, None if tensile is None else tensile.strain)
        readings = sum(len(part) for part in parts if part is not None)
        saved = 0
        if self._bins is not None:
            bins, strokes = self._bins.bins, self._bins.strokes
            saved = 0 if strokes is None else len(bins) * strokes.saved
            if self._bins.white_only:
                readings += len(bins.nodes.force) // 2 - len(bins)
        return readings * (1 + sum(self.model.linear_sizes)) - saved

    def log_posterior(self, u: Array) -> Array:
        """Log posterior density (B,) of sampler coordinates u (B, d), whose prior is standard normal."""
        prior = -0.5 * np.sum(u**2, axis=1) - 0.5 * u.shape[1] * LOG_2PI
        result = np.full(len(u), -np.inf)
        inside = np.all(np.isfinite(u), axis=1) & np.all(np.abs(u) < 37.0, axis=1)
        if inside.any():
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):  # shapes that no muscle has
                likelihood = self.log_likelihood(self.model.values(u[inside]))
            result[inside] = prior[inside] + np.where(np.isfinite(likelihood), likelihood, -np.inf)
        return result

    def log_likelihood(self, values: Values) -> Array:
        """ln p(y | θ), (B,)."""
        return self._solve(values)[0]

    def linear_draws(self, values: Values, rng: np.random.Generator) -> Array:
        """One draw of η (B, k) for each θ, from its exact conditional distribution."""
        _, centre, factor = self._solve(values)
        # factor is the Cholesky factor L of S: L⁻ᵀ z has covariance S⁻¹.
        return solve_transposed(factor, centre + rng.standard_normal(centre.shape))

    def linear_mean(self, values: Values) -> Array:
        """Conditional mean (B, k) of η."""
        _, centre, factor = self._solve(values)
        return solve_transposed(factor, centre)

    def linear_moments(self, values: Values) -> tuple[Array, Array]:
        """Conditional mean (B, k) and covariance (B, k, k) of η."""
        _, centre, factor = self._solve(values)
        return solve_transposed(factor, centre), inverse(factor @ np.swapaxes(factor, 1, 2))

    def free_noise(self, values: Values) -> list[Array]:
        """Noise (B, n), N, of the bins and then of the points that are seen, where it is Student-t."""
        mean = self.linear_mean(values)
        free = [one.free for one in self._added(values) if one.free is not None]
        return [rows.scale * rows.noise(mean) for rows in free]

    def _solve(self, values: Values) -> tuple[Array, Array, Array]:
        """ln p(y | θ), and L⁻¹ h (B, k) with the Cholesky factor L of S (B, k, k): the mean is L⁻ᵀ L⁻¹ h."""
        added = self._added(values)
        slack = [one.slack for one in added if one.slack is not None]
        free = [one.free for one in added if one.free is not None]
        gram, pull, constant = total([one.piece for one in added])
        sampled = self.model.moduli_of(values)
        diagonal = np.arange(gram.shape[1])
        gram[:, diagonal, diagonal] += 1.0
        if slack:
            value, mean, factor = with_slack(gram, pull, constant, slack)
            centre = np.einsum("bkl,bk->bl", factor, mean)
        else:
            factor, centre = condense(gram, pull)
            value = -0.5 * (constant - np.sum(centre**2, axis=1) + log_determinant(factor))
            mean = solve_transposed(factor, centre) if free else centre
        for rows in free:
            value = value + rows.correction(mean, values[FREEDOM][:, 0])
        if sampled is not None:  # nothing else told of them, and they are known
            p = sampled.shape[1]
            factor[:, range(p), range(p)] = KNOWN
            centre[:, :p] = KNOWN * sampled
        return value, centre, factor

    def _added(self, values: Values) -> list[Added]:
        """What each data set adds."""
        added = [share.at(values) for share in (self._bins, self._points) if share is not None]
        if self.data.tensile is not None and self.model.tensile is not None:
            added.append(Added(tensile_piece(self.model, values, self.data.tensile)))
        return added
