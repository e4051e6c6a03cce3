"""The collapsed posterior: everything the force is linear in is integrated out exactly.

y = f(θ) + A(θ) η + ε, η ~ N(0, I), ε ~ N(0, C(θ)), so with S = I + Aᵀ C⁻¹ A and h = Aᵀ C⁻¹ (y − f)
    ln p(y | θ) = −½ [(y − f)ᵀ C⁻¹ (y − f) − hᵀ S⁻¹ h + ln|C| + ln|S| + n ln 2π],
    η | θ, y ~ N(S⁻¹ h, S⁻¹).
Slack rows enter through the probability of being slack and a Laplace approximation in η
(:mod:`mpam_calib.posterior.density.slack`), Student-t noise through one Gaussian site for each row
(:mod:`mpam_calib.posterior.likelihood.sites`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import CONTRACTION_SD, Model
from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, TIME, WHITE, grown
from mpam_calib.model.remainder import ROUGH, SMOOTH
from mpam_calib.posterior.density.free_ends import FreeEnds
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.piece import Piece, forget, segment_piece, total, white_piece
from mpam_calib.posterior.density.slack import Slack, with_slack
from mpam_calib.posterior.density.tensile_piece import tensile_piece
from mpam_calib.posterior.likelihood.algebra import (
    LOG_2PI,
    condense,
    inverse,
    log_determinant,
    solve_transposed,
)
from mpam_calib.posterior.likelihood.bins import SLACK_ABOVE, LoopBins
from mpam_calib.posterior.likelihood.covariance import (
    StrokeCovariance,
    fast_noise_covariance,
    fast_noise_log_likelihood,
)
from mpam_calib.posterior.likelihood.points import FREE, Points
from mpam_calib.posterior.likelihood.scatter import Scatter
from mpam_calib.posterior.likelihood.sites import FreeRows, Sites, chunk_log_likelihood, usual_chunks
from mpam_calib.posterior.likelihood.strokes import Strokes
from mpam_calib.posterior.likelihood.tensile_points import TensilePoints
from mpam_calib.posterior.likelihood.white import white_terms

KNOWN = 1e9
"""Precision's root of coordinates that are given."""

Array = NDArray[np.float64]
Values = Mapping[str, Array]
Place = slice | NDArray[np.int64]


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

    @property
    def cells(self) -> int:
        """Readings × columns that one θ takes in memory."""
        bins, points, tensile = self.data.bins, self.data.points, self.data.tensile
        parts = (bins, points, None if tensile is None else tensile.strain)
        readings = sum(len(part) for part in parts if part is not None)
        saved = 0 if bins is None or self._strokes is None else len(bins) * self._strokes.saved
        if bins is not None and self.white_only:
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

    def _solve(self, values: Values) -> tuple[Array, Array, Array]:
        """ln p(y | θ), and L⁻¹ h (B, k) with the Cholesky factor L of S (B, k, k): the mean is L⁻ᵀ L⁻¹ h."""
        slack: list[Slack] = []
        free: list[FreeRows] = []
        gram, pull, constant = total(self._pieces(values, slack, free))
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

    def _pieces(self, values: Values, slack: list[Slack], free: list[FreeRows]) -> list[Piece]:
        pieces = []
        if self.data.bins is not None:
            pieces.append(self._bins(values, self.data.bins, slack, free))
        if self.data.points is not None:
            pieces.append(self._points(values, self.data.points, slack, free))
        if self.data.tensile is not None and self.model.tensile is not None:
            pieces.append(tensile_piece(self.model, values, self.data.tensile))
        return pieces

    @cached_property
    def _layout(self) -> StrokeCovariance:
        assert self.data.bins is not None
        return StrokeCovariance.build(self.data.bins)

    @cached_property
    def _bin_remainder(self) -> Array | None:
        if self.model.remainder is None or self.data.bins is None:
            return None
        return self.model.remainder.columns(self.data.bins.middle())

    @cached_property
    def _point_remainder(self) -> Array | None:
        if self.model.remainder is None or self.data.points is None:
            return None
        return self.model.remainder.columns(self.data.points.readings)

    @cached_property
    def _free_ends(self) -> FreeEnds | None:
        if self.data.points is None or not self.model.coordinates_sampled:
            return None
        return FreeEnds.build(self.data.points, self.model)

    def _design(self, values: Values, moduli: Array, remainder: Array | None) -> Array:
        """All columns (B, n, k) out of the moduli's (B, n, p) and the remainder's (n, q)."""
        result = np.zeros((len(next(iter(values.values()))), moduli.shape[1], sum(self.model.linear_sizes)))
        self._fill(result, slice(None), values, moduli, remainder)
        return result

    def _fill(
        self, result: Array, place: Place, values: Values, moduli: Array, remainder: Array | None
    ) -> None:
        """Write all columns into the rows at ``place`` of an array (B, rows, k or more)."""
        p, q, _ = self.model.linear_sizes
        result[:, place, :p] = moduli
        if remainder is not None:
            result[:, place, p : p + q] = values[SMOOTH][:, :, None] * remainder

    def _bins(self, values: Values, bins: LoopBins, slack: list[Slack], free: list[FreeRows]) -> Piece:
        assert self.model.chain is not None
        dof = values[FREEDOM][:, 0] if FREEDOM in values else None
        uneven = GROWTH in values or dof is not None
        if self.white_only:
            return self._white_bins(values, bins)
        if self._strokes is not None:
            return self._even_bins(values, bins, self._strokes)
        n = len(bins)
        terms = self.model.chain.terms(values, bins.readings, self.guide.bins, self.guide.bin_echo)
        fixed = 0.5 * (terms.fixed[:, :n] + terms.fixed[:, n:])
        columns = 0.5 * (terms.columns[:, :n] + terms.columns[:, n:])
        white, correlated, time, rough = self._noise(values)
        B = len(white)
        layout = self._layout
        residual = np.broadcast_to(bins.force - fixed, (B, n))
        kind = layout.kind
        if uneven:
            growth = self._growth(values, self._bin_force)
            scale = white[:, None] * growth / np.sqrt(layout.rows_of(bins) * bins.averaged)
            sites = Sites.at(self.guide.bin_noise, scale, dof)
            residual = residual - scale * sites.shift
            covariance = layout.of_each(white, correlated, time, rough, growth, sites.spread)
            kind = np.arange(bins.segments)
        else:
            covariance = layout.matrix(white, correlated, time, rough)
        padded = np.zeros((B, layout.pad.size, sum(self.model.linear_sizes) + 1))
        self._fill(padded, layout.place, values, columns, self._bin_remainder)
        padded[:, layout.place, -1] = residual
        lost = layout.pad
        if bins.slack.any():
            sd = np.sqrt(white[:, None] ** 2 + correlated[:, None] ** 2 + rough[:, None] ** 2)
            rows = bins.slack
            # Slack readings stay within some sds of one above the floor; the force may be as high.
            floor = self.data.floor + SLACK_ABOVE * np.broadcast_to(white[:, None], (B, int(rows.sum())))
            slack.append(
                Slack(
                    np.broadcast_to(fixed, (B, n))[:, rows],
                    padded[:, bins.segment[rows] * bins.width + bins.position[rows], :-1],
                    floor,
                    np.broadcast_to(sd, floor.shape),
                )
            )
            lost = lost | bins.slack[layout.index]
            covariance = forget(covariance[:, kind], lost)
            kind = np.arange(bins.segments)
            padded[:, lost.ravel()] = 0.0
        piece, weighted = segment_piece(covariance, kind, padded, int((~lost).sum()))
        if dof is not None:
            at = layout.index[~lost]
            seen = weighted[:, ~lost.ravel()]
            free.append(FreeRows(seen[..., :-1], seen[..., -1], scale[:, at], sites.take(at)))
        if bins.scatter is not None and bins.chunks is not None:
            if uneven:
                covariance = fast_noise_covariance(bins.scatter, bins.averaged, white, correlated, time)
                usual = self._usual_chunks if dof is not None else np.ones(len(bins.chunks[1]), dtype=bool)
                at = bins.chunks[1][usual]
                fast = chunk_log_likelihood(covariance, bins.chunks[0][usual], growth[:, at])
            else:
                fast = fast_noise_log_likelihood(bins.scatter, bins.averaged, white, correlated, time)
            piece = piece._replace(constant=piece.constant - 2.0 * fast)
        return piece

    def _noise(self, values: Values) -> tuple[Array, Array, Array, Array]:
        """White and correlated sd (N), time constant (s), the strokes' own remainder (N), each (B,)."""
        white = values[WHITE][:, 0]
        given = {CORRELATED: np.zeros_like(white), TIME: np.ones_like(white), ROUGH: np.zeros_like(white)}
        for name in given.keys() & values.keys():
            given[name] = values[name][:, 0]
        return white, given[CORRELATED], given[TIME], given[ROUGH]

    def _even_bins(self, values: Values, bins: LoopBins, strokes: Strokes) -> Piece:
        """Bins whose noise is Gaussian and alike in all of them."""
        assert self.model.chain is not None
        white, correlated, time, rough = self._noise(values)
        guide, echo = self.guide.bins, self.guide.bin_echo
        fixed, slope, linear, _ = self.model.chain.factored(values, bins.readings, guide, echo)
        columns = linear.every()
        n, B, p = len(bins), len(white), columns.shape[-1]
        slope = 0.5 * np.broadcast_to(slope, (len(slope), 2 * n))
        known = np.empty((p + 1, B, n))
        for one, column in zip(known, np.moveaxis(columns, 2, 0), strict=False):
            np.multiply(slope[:, :n], column[:, :n], out=one)
            one += slope[:, n:] * column[:, n:]
        known[p] = bins.force - 0.5 * (fixed[:, :n] + fixed[:, n:])
        amplitude = values[SMOOTH][:, 0] if SMOOTH in values else np.zeros(B)
        full, log_det = strokes.products(strokes.factor(white, correlated, time, rough), known, amplitude)
        constant = full[:, -1, -1] + log_det + n * LOG_2PI
        if self._scatter is not None:
            constant = constant - 2.0 * self._scatter.log_likelihood(white, correlated, time)
        return Piece(full[:, :-1, :-1], full[:, :-1, -1], constant).widened(sum(self.model.linear_sizes))

    @cached_property
    def white_only(self) -> bool:
        """Whether all bins have readings whose noise is white and of one size."""
        bins = self.data.bins
        others = {GROWTH, FREEDOM, CORRELATED, ROUGH} & set(self.model.names)
        return bins is not None and not others and not bool(bins.slack.any())

    @cached_property
    def _node_guide(self) -> tuple[Array | None, Array | None]:
        """The guide's force (N) at the bins' nodes, and its echo there."""
        assert self.data.bins is not None
        return self.guide.at_nodes(self.data.bins)

    @cached_property
    def _strokes(self) -> Strokes | None:
        """The bins, where their noise allows them to be taken as one."""
        bins, names = self.data.bins, self.model.names
        uneven = bins is None or bins.slack.any() or GROWTH in names or FREEDOM in names
        if uneven or not (CORRELATED in names or ROUGH in names) or (steps := self._layout.steps) is None:
            return None
        return Strokes.build(self._layout, steps, self._bin_remainder)

    @cached_property
    def _scatter(self) -> Scatter | None:
        bins = self.data.bins
        assert bins is not None
        return None if bins.scatter is None else Scatter.build(bins.scatter, bins.averaged)

    @property
    def _bin_force(self) -> Array:
        """Force (n,) by which the noise of bins grows: the guide's, at first the measured one."""
        assert self.data.bins is not None
        if self.guide.bins is None:
            return self.data.bins.force
        return np.asarray(self.guide.bins.reshape(2, -1).mean(axis=0))

    @cached_property
    def _usual_chunks(self) -> NDArray[np.bool_]:
        bins = self.data.bins
        assert bins is not None and bins.chunks is not None
        return usual_chunks(bins.chunks[0], bins.force[bins.chunks[1]])

    def _growth(self, values: Values, force: Array) -> Array:
        """Factor (B, n) on the noise's sd."""
        setting = self.model.setting
        assert setting is not None
        none = np.zeros_like(values[WHITE])
        return grown(values.get(GROWTH, none), force, setting.force_scale)

    def free_noise(self, values: Values) -> list[Array]:
        """Noise (B, n), N, of the bins and then of the points that are seen, where it is Student-t."""
        mean = self.linear_mean(values)
        free: list[FreeRows] = []
        self._pieces(values, [], free)
        return [rows.scale * rows.noise(mean) for rows in free]

    def _white_bins(self, values: Values, bins: LoopBins) -> Piece:
        """Bins without correlated noise and remainder: all rows count, at less cost."""
        assert self.model.chain is not None
        nodes = bins.nodes
        fixed, slope, linear, _ = self.model.chain.factored(values, nodes.readings, *self._node_guide)
        white = values[WHITE][:, 0]
        piece = white_terms(nodes, bins.averaged, fixed, slope, linear.every(), white)
        return Piece(*piece).widened(sum(self.model.linear_sizes))

    def _points(self, values: Values, points: Points, slack: list[Slack], free: list[FreeRows]) -> Piece:
        assert self.model.chain is not None
        terms = self.model.chain.terms(values, points.readings, self.guide.points, self.guide.point_echo)
        fixed, columns = terms.fixed, terms.columns
        moduli = self.model.moduli_of(values)
        ends = None
        if moduli is not None:
            if self._free_ends is not None:
                ends = self._free_ends.at(values, moduli, self.guide.contradicted)
            fixed, columns = fixed + np.einsum("bnp,bp->bn", columns, moduli), np.zeros_like(columns)
        design = self._design(values, columns, self._point_remainder)
        B = len(design)
        variance = np.broadcast_to(values[WHITE] ** 2, (B, len(points))).copy()
        if GROWTH in values:
            force = points.force if self.guide.points is None else self.guide.points
            variance *= self._growth(values, force) ** 2
        at_zero = points.kind == FREE
        if ends is not None:
            fixed[:, at_zero] = ends.force
        if at_zero.any():
            assert self.model.setting is not None
            slope = np.zeros(len(points)) if self.guide.slope is None else self.guide.slope
            falls = self.model.setting.geometry.L0 * (slope[at_zero] if ends is None else ends.slope)
            variance[:, at_zero] += (values[CONTRACTION_SD] * falls) ** 2
        residual = np.broadcast_to(points.force - fixed, (B, len(points)))
        seen = ~points.censored
        if points.censored.any():
            rows = points.censored
            slack.append(
                Slack(
                    np.broadcast_to(fixed, (B, len(points)))[:, rows],
                    design[:, rows],
                    np.tile(np.where(points.kind[rows] == FREE, 0.0, self.data.floor), (B, 1)),
                    np.sqrt(variance[:, rows]),
                )
            )
        design, residual, spread = design[:, seen], residual[:, seen], variance[:, seen]
        if FREEDOM in values:
            scale = np.sqrt(spread)
            noise = None if self.guide.point_noise is None else self.guide.point_noise[seen]
            sites = Sites.at(noise, scale, values[FREEDOM][:, 0])
            spread = spread * sites.spread
            residual = residual - scale * sites.shift
            free.append(FreeRows(design / spread[..., None], residual / spread, scale, sites))
        piece = white_piece(design, residual, spread)
        return piece if ends is None else piece._replace(constant=piece.constant - 2.0 * ends.log_weight)
