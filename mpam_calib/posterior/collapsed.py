"""The collapsed posterior: everything the force is linear in is integrated out exactly.

y = f(θ) + A(θ) η + ε, η ~ N(0, I), ε ~ N(0, C(θ)), so with S = I + Aᵀ C⁻¹ A and h = Aᵀ C⁻¹ (y − f)
    ln p(y | θ) = −½ [(y − f)ᵀ C⁻¹ (y − f) − hᵀ S⁻¹ h + ln|C| + ln|S| + n ln 2π],
    η | θ, y ~ N(S⁻¹ h, S⁻¹).
Slack rows enter through the probability of being slack and a Laplace approximation in η
(:func:`_with_slack`).
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.model.model import CONTRACTION_SD, Model
from mpam_calib.model.noise import CORRELATED, TIME, WHITE
from mpam_calib.model.remainder import ROUGH, SMOOTH
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.bins import LoopBins
from mpam_calib.posterior.covariance import StrokeCovariance, fast_noise_log_likelihood
from mpam_calib.posterior.points import Points, TensilePoints
from mpam_calib.posterior.white import white_terms

Array = NDArray[np.float64]
Values = Mapping[str, Array]

LOG_2PI = float(np.log(2.0 * np.pi))
NEWTON_STEPS = 6
WRONG_FLAG = 0.01
"""Share of slack flags that may be wrong: one of them must not outweigh all other readings."""


class Piece(NamedTuple):
    """One data set's share: Aᵀ C⁻¹ A (B, k, k), Aᵀ C⁻¹ r (B, k), rᵀ C⁻¹ r + ln|C| + n ln 2π (B,)."""

    gram: Array
    pull: Array
    constant: Array


class Slack(NamedTuple):
    """Censored rows: force (B, n) without η, its columns (B, n, k), floor and sd (B, n), N."""

    fixed: Array
    columns: Array
    floor: Array
    sd: Array


@dataclass(frozen=True)
class Data:
    """What a posterior is conditioned on; any part may be None. ``floor`` in N."""

    bins: LoopBins | None
    points: Points | None
    tensile: TensilePoints | None
    floor: float = 0.0


@dataclass(frozen=True)
class Guide:
    """A force estimate at the bins' Gauss points and at the points (N), and the slope there (N/m)."""

    bins: Array | None = None
    points: Array | None = None
    slope: Array | None = None


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
        for piece in self._pieces(values, slack):
            gram += piece.gram
            pull += piece.pull
            constant = constant + piece.constant
        if slack:
            return _with_slack(gram, pull, constant, slack)
        factor = _cholesky(gram)
        mean = _solve(gram, pull)
        return _gaussian(constant, pull, mean, factor), mean, factor

    def _pieces(self, values: Values, slack: list[Slack]) -> list[Piece]:
        pieces = []
        if self.data.bins is not None:
            pieces.append(self._bins(values, self.data.bins, slack))
        if self.data.points is not None:
            pieces.append(self._points(values, self.data.points, slack))
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
        B, n = np.broadcast_shapes(moduli.shape[:2], (len(next(iter(values.values()))), moduli.shape[1]))
        sizes = self.model.linear_sizes
        result = np.zeros((B, n, sum(sizes)))
        result[:, :, : sizes[0]] = moduli
        if remainder is not None:
            result[:, :, sizes[0] : sizes[0] + sizes[1]] = values[SMOOTH][:, :, None] * remainder
        return result

    def _bins(self, values: Values, bins: LoopBins, slack: list[Slack]) -> Piece:
        assert self.model.chain is not None
        if CORRELATED not in values and ROUGH not in values and not bins.slack.any():
            return self._white_bins(values, bins)
        n = len(bins)
        terms = self.model.chain.terms(values, bins.readings, self.guide.bins)
        fixed = 0.5 * (terms.fixed[:, :n] + terms.fixed[:, n:])
        columns = 0.5 * (terms.columns[:, :n] + terms.columns[:, n:])
        design = self._design(values, columns, self._bin_remainder)
        B = len(design)
        white = values[WHITE][:, 0]
        zero = np.zeros(B)
        correlated = values[CORRELATED][:, 0] if CORRELATED in values else zero
        time = values[TIME][:, 0] if TIME in values else zero + 1.0
        rough = values[ROUGH][:, 0] if ROUGH in values else zero
        layout = self._layout
        covariance = layout.matrix(white, correlated, time, rough)
        residual = np.broadcast_to(bins.force - fixed, (B, n))
        lost = layout.pad
        if bins.slack.any():
            sd = np.sqrt(white[:, None] ** 2 + correlated[:, None] ** 2 + rough[:, None] ** 2)
            rows = bins.slack
            # A fifth of the readings at the floor: the force is at most 0.84 sd of a reading above it.
            floor = self.data.floor + 0.84 * np.broadcast_to(white[:, None], (B, int(rows.sum())))
            slack.append(
                Slack(
                    np.broadcast_to(fixed, (B, n))[:, rows],
                    design[:, rows],
                    floor,
                    np.broadcast_to(sd, floor.shape),
                )
            )
            lost = lost | bins.slack[layout.index]
            covariance = _forget(covariance[:, layout.kind], lost)
        stacked = np.concatenate([design, residual[..., None]], axis=-1)
        padded = np.where(lost[None, :, :, None], 0.0, stacked[:, layout.index])
        kind = np.arange(len(lost)) if bins.slack.any() else layout.kind
        piece = _segment_piece(covariance, kind, padded, int((~lost).sum()))
        if bins.scatter is not None:
            fast = fast_noise_log_likelihood(bins.scatter, bins.averaged, white, correlated, time)
            piece = piece._replace(constant=piece.constant - 2.0 * fast)
        return piece

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

    def _points(self, values: Values, points: Points, slack: list[Slack]) -> Piece:
        assert self.model.chain is not None
        terms = self.model.chain.terms(values, points.readings, self.guide.points)
        design = self._design(values, terms.columns, self._point_remainder)
        B = len(design)
        variance = np.broadcast_to(values[WHITE] ** 2, (B, len(points))).copy()
        free = points.kind == 2
        if free.any():
            slope = self.guide.slope if self.guide.slope is not None else np.zeros(len(points))
            length = self.model.setting.geometry.L0 if self.model.setting else 1.0
            variance[:, free] += (values[CONTRACTION_SD] * length * slope[free]) ** 2
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
        return _white_piece(design[:, seen], residual[:, seen], variance[:, seen])

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


def _solve(matrix: Array, right: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix, right[..., None])[..., 0], dtype=np.float64)


def _cholesky(matrix: Array) -> Array:
    """Cholesky factors; nan for a matrix that rounding has made indefinite (its density counts as 0)."""
    try:
        return np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        factor = np.full_like(matrix, np.nan)
        for index in np.ndindex(matrix.shape[:-2]):
            with contextlib.suppress(np.linalg.LinAlgError):
                factor[index] = np.linalg.cholesky(matrix[index])
        return factor


def _white_piece(design: Array, residual: Array, variance: Array) -> Piece:
    weighted = design / variance[..., None]
    gram = np.swapaxes(design, 1, 2) @ weighted
    pull = np.einsum("bnk,bn->bk", weighted, residual)
    constant = np.sum(residual**2 / variance + np.log(variance) + LOG_2PI, axis=1)
    return Piece(gram, pull, constant)


def _segment_piece(covariance: Array, kind: NDArray[np.int64], padded: Array, rows: int) -> Piece:
    """Correlated segments: covariance (B, K, m, m), kind (S,), [A r] padded (B, S, m, k + 1)."""
    B, S, m, width = padded.shape
    factor = _cholesky(covariance)
    log_dets = 2.0 * np.sum(np.log(np.diagonal(factor, axis1=2, axis2=3)), axis=2)
    log_det = log_dets @ np.bincount(kind, minlength=covariance.shape[1])
    weighted = (np.linalg.inv(covariance)[:, kind] @ padded).reshape(B, S * m, width)
    full = np.swapaxes(padded.reshape(B, S * m, width), 1, 2) @ weighted
    return Piece(full[:, :-1, :-1], full[:, :-1, -1], full[:, -1, -1] + log_det + rows * LOG_2PI)


def _forget(covariance: Array, lost: NDArray[np.bool_]) -> Array:
    """Give lost rows unit variance and no covariance, so that they carry no information."""
    either = lost[:, :, None] | lost[:, None, :]
    eye = np.eye(lost.shape[1])
    return np.where(either, eye * lost[:, :, None], covariance)


def _gaussian(constant: Array, pull: Array, mean: Array, factor: Array) -> Array:
    log_det = 2.0 * np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    result: Array = -0.5 * (constant - np.einsum("bk,bk->b", pull, mean) + log_det)
    return result


def _with_slack(gram: Array, pull: Array, constant: Array, parts: list[Slack]) -> tuple[Array, Array, Array]:
    """Laplace's approximation in η with slack rows: the better of two climbs.

    A slack row says ln((1 − ε) Φ((floor − f − Aη)/sd) + ε). One climb starts from all other rows' fit,
    where a wrong flag is left aside at once; the other takes all flags at their word first.
    """
    whole = Slack(*(np.concatenate(arrays, axis=1) for arrays in zip(*parts, strict=True)))
    start = _solve(gram, pull)
    trusting = _climb(gram, pull, whole, start, 0.0)
    ends = [_climb(gram, pull, whole, first, WRONG_FLAG) for first in (start, trusting)]
    found = [_laplace(gram, pull, constant, whole, eta) for eta in ends]
    value, mean, factor = found[0]
    better = found[1][0] > value
    return (
        np.where(better, found[1][0], value),
        np.where(better[:, None], found[1][1], mean),
        np.where(better[:, None, None], found[1][2], factor),
    )


def _slack_terms(slack: Slack, eta: Array, wrong: float) -> tuple[Array, Array, Array]:
    """Sum of the rows' log probabilities (B,), their slopes and (clipped) curvatures in force (B, n)."""
    z = (slack.floor - slack.fixed - np.einsum("bnk,bk->bn", slack.columns, eta)) / slack.sd
    log_cdf = special.log_ndtr(z) + np.log1p(-wrong)
    # φ/Φ by the scaled error function: both underflow far from the floor.
    ratio = np.sqrt(2.0 / np.pi) / special.erfcx(-z / np.sqrt(2.0))
    log_term = np.logaddexp(log_cdf, np.log(wrong)) if wrong else log_cdf
    share = np.exp(log_cdf - log_term)
    curvature = share * ratio * (z + ratio) - share * (1.0 - share) * ratio**2
    return log_term.sum(axis=1), share * ratio / slack.sd, np.clip(curvature, 0.0, 1.0) / slack.sd**2


def _climb(gram: Array, pull: Array, slack: Slack, eta: Array, wrong: float) -> Array:
    for _ in range(NEWTON_STEPS):
        _, slope, curvature = _slack_terms(slack, eta, wrong)
        gradient = pull - np.einsum("bkl,bl->bk", gram, eta) - np.einsum("bnk,bn->bk", slack.columns, slope)
        eta = eta + _solve(_slack_hessian(gram, slack, curvature), gradient)
    return eta


def _slack_hessian(gram: Array, slack: Slack, curvature: Array) -> Array:
    result: Array = gram + np.swapaxes(slack.columns, 1, 2) @ (slack.columns * curvature[..., None])
    return result


def _laplace(
    gram: Array, pull: Array, constant: Array, slack: Slack, eta: Array
) -> tuple[Array, Array, Array]:
    log_term, _, curvature = _slack_terms(slack, eta, WRONG_FLAG)
    factor = _cholesky(_slack_hessian(gram, slack, curvature))
    log_det = 2.0 * np.sum(np.log(np.diagonal(factor, axis1=1, axis2=2)), axis=1)
    quadratic = np.einsum("bk,bkl,bl->b", eta, gram, eta) - 2.0 * np.einsum("bk,bk->b", pull, eta)
    value: Array = log_term - 0.5 * (constant + quadratic + log_det)
    return value, eta, factor
