"""The collapsed posterior: everything the force is linear in is integrated out exactly.

y = f(θ) + A(θ) η + ε, η ~ N(0, I), ε ~ N(0, C(θ)), so with S = I + Aᵀ C⁻¹ A and h = Aᵀ C⁻¹ (y − f)
    ln p(y | θ) = −½ [(y − f)ᵀ C⁻¹ (y − f) − hᵀ S⁻¹ h + ln|C| + ln|S| + n ln 2π],
    η | θ, y ~ N(S⁻¹ h, S⁻¹).
Slack rows enter through the probability of being slack and a Laplace approximation in η
(:mod:`mpam_calib.posterior.slack`), Student-t noise through one Gaussian site for each row
(:mod:`mpam_calib.posterior.sites`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import CONTRACTION_SD, Model
from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, TIME, WHITE, grown
from mpam_calib.model.remainder import ROUGH, SMOOTH
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.algebra import cholesky, log_determinant, solve
from mpam_calib.posterior.bins import LoopBins
from mpam_calib.posterior.covariance import StrokeCovariance, fast_noise_covariance, fast_noise_log_likelihood
from mpam_calib.posterior.points import Points, TensilePoints
from mpam_calib.posterior.sites import FreeRows, Sites, chunk_log_likelihood, usual_chunks
from mpam_calib.posterior.slack import Slack, with_slack
from mpam_calib.posterior.white import white_terms

Array = NDArray[np.float64]
Values = Mapping[str, Array]
Place = slice | NDArray[np.int64]

LOG_2PI = float(np.log(2.0 * np.pi))


class Piece(NamedTuple):
    """One data set's share: Aᵀ C⁻¹ A (B, k, k), Aᵀ C⁻¹ r (B, k), rᵀ C⁻¹ r + ln|C| + n ln 2π (B,)."""

    gram: Array
    pull: Array
    constant: Array


@dataclass(frozen=True)
class Data:
    """What a posterior is conditioned on; any part may be None. ``floor`` in N."""

    bins: LoopBins | None
    points: Points | None
    tensile: TensilePoints | None
    floor: float = 0.0


@dataclass(frozen=True)
class Guide:
    """A force estimate at the bins' Gauss points and at the points (N), and the slope there (N/m).

    ``bin_noise`` and ``point_noise`` (N) are where the sites of Student-t noise are settled.
    """

    bins: Array | None = None
    points: Array | None = None
    slope: Array | None = None
    bin_noise: Array | None = None
    point_noise: Array | None = None


@dataclass(frozen=True)
class Collapsed:
    """ln p(y | θ) for many θ at once, and exact draws of the linear coordinates."""

    model: Model
    data: Data
    guide: Guide

    def log_posterior(self, u: Array) -> Array:
        """Log posterior density (B,) of sampler coordinates u (B, d), whose prior is standard normal."""
        prior = -0.5 * np.sum(u**2, axis=1) - 0.5 * u.shape[1] * LOG_2PI
        result = np.full(len(u), -np.inf)
        inside = np.all(np.isfinite(u), axis=1) & np.all(np.abs(u) < 37.0, axis=1)
        if inside.any():
            likelihood = self.log_likelihood(self.model.values(u[inside]))
            result[inside] = prior[inside] + np.where(np.isfinite(likelihood), likelihood, -np.inf)
        return result

    def log_likelihood(self, values: Values) -> Array:
        """ln p(y | θ), (B,)."""
        return self._solve(values)[0]

    def linear_draws(self, values: Values, rng: np.random.Generator) -> Array:
        """One draw of η (B, k) for each θ, from its exact conditional distribution."""
        _, mean, factor = self._solve(values)
        noise = rng.standard_normal(mean.shape)
        # factor is the Cholesky factor L of S: L⁻ᵀ z has covariance S⁻¹.
        shift = np.linalg.solve(np.swapaxes(factor, 1, 2), noise[..., None])[..., 0]
        return np.asarray(mean + shift)

    def linear_mean(self, values: Values) -> Array:
        """Conditional mean (B, k) of η."""
        return self._solve(values)[1]

    def _solve(self, values: Values) -> tuple[Array, Array, Array]:
        B = len(next(iter(values.values())))
        k = sum(self.model.linear_sizes)
        gram = np.zeros((B, k, k))
        gram[:, np.arange(k), np.arange(k)] = 1.0
        pull = np.zeros((B, k))
        constant = np.zeros(B)
        slack: list[Slack] = []
        free: list[FreeRows] = []
        for piece in self._pieces(values, slack, free):
            gram += piece.gram
            pull += piece.pull
            constant = constant + piece.constant
        if slack:
            value, mean, factor = with_slack(gram, pull, constant, slack)
        else:
            factor, mean = cholesky(gram), solve(gram, pull)
            value = -0.5 * (constant - np.einsum("bk,bk->b", pull, mean) + log_determinant(factor))
        for rows in free:
            value = value + rows.correction(mean, values[FREEDOM][:, 0])
        return value, mean, factor

    def _pieces(self, values: Values, slack: list[Slack], free: list[FreeRows]) -> list[Piece]:
        pieces = []
        if self.data.bins is not None:
            pieces.append(self._bins(values, self.data.bins, slack, free))
        if self.data.points is not None:
            pieces.append(self._points(values, self.data.points, slack, free))
        if self.data.tensile is not None and self.model.tensile is not None:
            pieces.append(self._tensile(values, self.data.tensile))
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
        if not (uneven or CORRELATED in values or ROUGH in values or bins.slack.any()):
            return self._white_bins(values, bins)
        n = len(bins)
        terms = self.model.chain.terms(values, bins.readings, self.guide.bins)
        fixed = 0.5 * (terms.fixed[:, :n] + terms.fixed[:, n:])
        columns = 0.5 * (terms.columns[:, :n] + terms.columns[:, n:])
        white = values[WHITE][:, 0]
        B = len(white)
        zero = np.zeros(B)
        correlated = values[CORRELATED][:, 0] if CORRELATED in values else zero
        time = values[TIME][:, 0] if TIME in values else zero + 1.0
        rough = values[ROUGH][:, 0] if ROUGH in values else zero
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
            # A fifth of the readings at the floor: the force is at most 0.84 sd of a reading above it.
            floor = self.data.floor + 0.84 * np.broadcast_to(white[:, None], (B, int(rows.sum())))
            slack.append(
                Slack(
                    np.broadcast_to(fixed, (B, n))[:, rows],
                    padded[:, bins.segment[rows] * bins.width + bins.position[rows], :-1],
                    floor,
                    np.broadcast_to(sd, floor.shape),
                )
            )
            lost = lost | bins.slack[layout.index]
            covariance = _forget(covariance[:, kind], lost)
            kind = np.arange(bins.segments)
            padded[:, lost.ravel()] = 0.0
        piece, weighted = _segment_piece(covariance, kind, padded, int((~lost).sum()))
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
        _, mean, _ = self._solve(values)
        free: list[FreeRows] = []
        self._pieces(values, [], free)
        return [rows.scale * rows.noise(mean) for rows in free]

    def _white_bins(self, values: Values, bins: LoopBins) -> Piece:
        """Bins without correlated noise and remainder: all rows count, at less cost."""
        assert self.model.chain is not None
        nodes = bins.nodes
        guide = nodes.interpolate(self.guide.bins, bins.readings.time)
        fixed, slope, columns = self.model.chain.factored(values, nodes.readings, guide)
        white = values[WHITE][:, 0]
        piece = white_terms(nodes, bins.averaged, fixed, slope, columns, white)
        if sum(self.model.linear_sizes) == columns.shape[-1]:
            return Piece(*piece)
        k, p = sum(self.model.linear_sizes), columns.shape[-1]
        gram, pull = np.zeros((len(white), k, k)), np.zeros((len(white), k))
        gram[:, :p, :p], pull[:, :p] = piece[0], piece[1]
        return Piece(gram, pull, piece[2])

    def _points(self, values: Values, points: Points, slack: list[Slack], free: list[FreeRows]) -> Piece:
        assert self.model.chain is not None
        terms = self.model.chain.terms(values, points.readings, self.guide.points)
        design = self._design(values, terms.columns, self._point_remainder)
        B = len(design)
        variance = np.broadcast_to(values[WHITE] ** 2, (B, len(points))).copy()
        if GROWTH in values:
            force = points.force if self.guide.points is None else self.guide.points
            variance *= self._growth(values, force) ** 2
        at_zero = points.kind == 2
        if at_zero.any():
            slope = self.guide.slope if self.guide.slope is not None else np.zeros(len(points))
            length = self.model.setting.geometry.L0 if self.model.setting else 1.0
            variance[:, at_zero] += (values[CONTRACTION_SD] * length * slope[at_zero]) ** 2
        residual = np.broadcast_to(points.force - terms.fixed, (B, len(points)))
        seen = ~points.censored
        if points.censored.any():
            rows = points.censored
            slack.append(
                Slack(
                    np.broadcast_to(terms.fixed, (B, len(points)))[:, rows],
                    design[:, rows],
                    np.full((B, int(rows.sum())), self.data.floor),
                    np.sqrt(variance[:, rows]),
                )
            )
        if FREEDOM not in values:
            return _white_piece(design[:, seen], residual[:, seen], variance[:, seen])
        scale = np.sqrt(variance[:, seen])
        noise = None if self.guide.point_noise is None else self.guide.point_noise[seen]
        sites = Sites.at(noise, scale, values[FREEDOM][:, 0])
        spread = variance[:, seen] * sites.spread
        residual = residual[:, seen] - scale * sites.shift
        free.append(FreeRows(design[:, seen] / spread[..., None], residual / spread, scale, sites))
        return _white_piece(design[:, seen], residual, spread)

    def _tensile(self, values: Values, tensile: TensilePoints) -> Piece:
        model = self.model.tensile
        assert model is not None and self.model.moduli is not None
        sizes = self.model.linear_sizes
        B = len(values[NOISE])
        mean, matrix = self.model.moduli.transform(values)
        powers = model.powers(tensile.strain)
        design = np.zeros((B, len(tensile.strain), sum(sizes)))
        design[:, :, : sizes[0]] = powers @ matrix
        if MISFIT in values:
            design[:, :, sizes[0] + sizes[1] :] = values[MISFIT][:, :, None] * model.remainder(tensile.strain)
        residual = np.broadcast_to(tensile.stress - powers @ mean[0], design.shape[:2])
        return _white_piece(design, residual, values[NOISE] ** 2 / tensile.count)


def _white_piece(design: Array, residual: Array, variance: Array) -> Piece:
    weighted = design / variance[..., None]
    gram = np.swapaxes(design, 1, 2) @ weighted
    pull = np.einsum("bnk,bn->bk", weighted, residual)
    constant = np.sum(residual**2 / variance + np.log(variance) + LOG_2PI, axis=1)
    return Piece(gram, pull, constant)


def _segment_piece(
    covariance: Array, kind: NDArray[np.int64], padded: Array, rows: int
) -> tuple[Piece, Array]:
    """Correlated segments: covariance (B, K, m, m), kind (S,), [A r] padded (B, S·m, k + 1); C⁻¹[A r]."""
    B, _, width = padded.shape
    m = covariance.shape[-1]
    log_dets = log_determinant(cholesky(covariance))
    log_det = log_dets @ np.bincount(kind, minlength=covariance.shape[1])
    inverse = np.linalg.inv(covariance)[:, kind]
    weighted = (inverse @ padded.reshape(B, -1, m, width)).reshape(padded.shape)
    full = np.swapaxes(padded, 1, 2) @ weighted
    piece = Piece(full[:, :-1, :-1], full[:, :-1, -1], full[:, -1, -1] + log_det + rows * LOG_2PI)
    return piece, weighted


def _forget(covariance: Array, lost: NDArray[np.bool_]) -> Array:
    """Give lost rows unit variance and no covariance, so that they carry no information."""
    either = lost[:, :, None] | lost[:, None, :]
    eye = np.eye(lost.shape[1])
    return np.where(either, eye * lost[:, :, None], covariance)
