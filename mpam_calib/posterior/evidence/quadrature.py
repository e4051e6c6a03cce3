"""The evidence by quadrature: Laplace's Gaussian gives the axes, the density itself what is integrated.

Laplace's approximation is off by tenths of a nat where a mode lies near a bound: the image u of a
half-normal or log-normal parameter then has a long flat tail to -∞. One dimension is integrated as it is.
In more, the density is followed along each axis of the mode's ellipsoid, and the product of these profiles
is the importance density of a randomised quasi-Monte Carlo rule. Where its weights are uneven the density is
bent, and :mod:`mpam_calib.posterior.evidence.nested` goes on.

Only the one mode is integrated, and what is narrow and far off the axes can be missed; ``error`` says how far
independent randomisations differ, no more. In ten dimensions along curved ridges the rounds do not settle:
the error then says so (``Evidence.reliable``), and Laplace's figure is the better one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, special
from scipy.stats import qmc

from mpam_calib.posterior.chains.effective import effective_share
from mpam_calib.posterior.density.mode import Density, Mode, evaluate
from mpam_calib.posterior.evidence.nested import Weighted, scatter, weigh_nested

Array = NDArray[np.float64]

LINE = np.linspace(-8.0, 8.0, 41)
"""Nodes of a one-dimensional integral, in Laplace sds."""
DROP = 20.0
"""Nats by which a one-dimensional density must have fallen where its integral ends ..."""
EXTENSIONS = 4
"""... or its line is lengthened, so many times at most."""
NODES = np.array([-6.0, -4.5, -3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0, 4.5, 6.0])
"""Nodes of a profile that only shapes the importance density."""
CELLS = np.linspace(-12.0, 12.0, 2001)
TEMPER = 0.95
"""Power of the profiles, for heavier tails than the density's."""
SHIFTS, FIRST, MOST = 4, 16, 256
"""Randomisations of the rule, and points of each: at first, and at most."""
GOOD_SHARE = 0.95
"""Effective share of the points below which the density is taken for bent."""
TOLERANCE = 0.008
"""Nats of error at which the rule ends."""
RELIABLE = 0.1
"""Error (nats) above which the randomisations have not settled, and the error is too small itself."""


def settled(value: float, error: float) -> bool:
    """Whether a log evidence and its error (nats) are figures to be used."""
    return bool(np.isfinite(value) and error <= RELIABLE)


class Evidence(NamedTuple):
    """ln ∫ p(y|θ) p(θ) dθ (nats), its error, and the posterior's mean (d,) and covariance (d, d)."""

    value: float
    error: float
    mean: Array
    covariance: Array

    @property
    def reliable(self) -> bool:
        """Whether the randomisations agree well enough for the figure to be used."""
        return settled(self.value, self.error)

    @classmethod
    def of_points(cls, value: float, error: float, u: Array, weight: Array) -> Evidence:
        """With the mean and covariance of points u (n, d) by their weights (n,), which add up to one."""
        mean = weight @ u
        return cls(value, error, mean, (u - mean).T @ ((u - mean) * weight[:, None]))


def integrate(density: Density, mode: Mode, seed: int = 0) -> Evidence:
    """Evidence of the density around a mode; ``seed`` randomises the rule (dimensions above one)."""
    d = len(mode.u)
    if d == 0:
        return Evidence(mode.log_posterior, 0.0, mode.u, mode.covariance)
    if d == 1:
        return _line(density, mode.u, float(np.sqrt(mode.covariance[0, 0])))
    rule = _Rule(density, mode, seed)
    rule.extend(FIRST)
    while rule.share >= GOOD_SHARE:
        if scatter(rule.weighted.log_weights)[1] <= TOLERANCE or rule.count >= MOST:
            return _summary(rule.weighted)
        rule.extend(rule.count)
    return _summary(weigh_nested(density, mode, seed))


def _summary(weighted: Weighted) -> Evidence:
    u = weighted.points.reshape(-1, weighted.points.shape[2])
    return Evidence.of_points(
        *scatter(weighted.log_weights), u, special.softmax(weighted.log_weights.ravel())
    )


def _line(density: Density, centre: Array, sd: float) -> Evidence:
    """Trapezoidal rule, against itself on every other node."""
    z = LINE
    step = float(z[1] - z[0])
    log_p = evaluate(density, centre + sd * z[:, None])
    for _ in range(EXTENSIONS):
        below, above = log_p[[0, -1]] > log_p.max() - DROP
        if not (below or above):
            break
        more = step * np.arange(1, len(LINE))
        added = np.concatenate([z[0] - more[::-1]] * bool(below) + [z[-1] + more] * bool(above))
        z = np.concatenate([z, added])
        log_p = np.concatenate([log_p, evaluate(density, centre + sd * added[:, None])])
        order = np.argsort(z)
        z, log_p = z[order], log_p[order]
    value = float(special.logsumexp(log_p) + np.log(step * sd))
    coarse = float(special.logsumexp(log_p[::2]) + np.log(2.0 * step * sd))
    weight = np.exp(log_p - special.logsumexp(log_p))
    return Evidence.of_points(value, abs(value - coarse), centre + sd * z[:, None], weight)


class _Rule:
    """Importance sampling by randomised Sobol' points in the product of the profiles along Laplace's axes."""

    def __init__(self, density: Density, mode: Mode, seed: int) -> None:
        d = len(mode.u)
        self.density, self.centre, self.root = density, mode.u, _axes(mode.covariance)
        along = mode.u + (NODES[:, None, None] * np.eye(d)).reshape(-1, d) @ self.root.T
        self.cumulative = _profiles(evaluate(density, along).reshape(len(NODES), d), TEMPER)
        self.engines = [qmc.Sobol(d, rng=np.random.default_rng([seed, k])) for k in range(SHIFTS)]
        self.weighted = Weighted(np.empty((SHIFTS, 0, d)), np.empty((SHIFTS, 0)))

    @property
    def count(self) -> int:
        """Points of each randomisation."""
        return int(self.weighted.points.shape[1])

    def extend(self, count: int) -> None:
        """Add points to each randomisation."""
        shares = np.concatenate([engine.random(count) for engine in self.engines])
        z, log_q = _place(self.cumulative, shares)
        u = self.centre + z @ self.root.T
        log_w = evaluate(self.density, u) - log_q + np.linalg.slogdet(self.root)[1]
        new = Weighted(u.reshape(SHIFTS, count, -1), log_w.reshape(SHIFTS, count))
        self.weighted = Weighted(
            *(np.concatenate(both, axis=1) for both in zip(self.weighted, new, strict=True))
        )

    @property
    def share(self) -> float:
        """Effective share of the points."""
        return effective_share(self.weighted.log_weights.ravel())


def _axes(covariance: Array) -> Array:
    """Root (d, d) whose first axis is the widest coordinate: the regression on it takes the others along."""
    order = np.argsort(-np.diag(covariance), kind="stable")
    root = np.empty_like(covariance)
    root[order] = np.linalg.cholesky(covariance[np.ix_(order, order)])
    return root


def _profiles(log_p: Array, temper: float) -> Array:
    """Distribution functions (CELLS, d) of the tempered profiles, from log densities (NODES, d)."""
    log_p = np.maximum(log_p - log_p.max(axis=0), -200.0)
    middle = 0.5 * (CELLS[1:] + CELLS[:-1])
    inside = interpolate.CubicSpline(NODES, log_p)(np.clip(middle, NODES[0], NODES[-1]))
    inside = np.minimum(inside, 1.0)
    # Beyond the nodes the fall goes on as steeply as between the last two, and at least a little.
    low = np.maximum((log_p[1] - log_p[0]) / (NODES[1] - NODES[0]), 0.5)
    high = np.minimum((log_p[-1] - log_p[-2]) / (NODES[-1] - NODES[-2]), -0.5)
    beyond = np.minimum(middle - NODES[0], 0.0)[:, None] * low
    beyond += np.maximum(middle - NODES[-1], 0.0)[:, None] * high
    mass = np.exp(temper * (inside + beyond)) + 1e-12
    cumulative = np.concatenate([np.zeros((1, log_p.shape[1])), np.cumsum(mass, axis=0)])
    result: Array = cumulative / cumulative[-1]
    return result


def _place(cumulative: Array, share: Array) -> tuple[Array, Array]:
    """Points (n, d) at these shares (n, d) of the profiles, and the log density (n,) with which they lie."""
    z = np.empty_like(share)
    log_q = np.zeros(len(share))
    for i in range(share.shape[1]):
        z[:, i] = np.interp(share[:, i], cumulative[:, i], CELLS)
        cell = np.clip(np.searchsorted(CELLS, z[:, i], side="right") - 1, 0, len(CELLS) - 2)
        mass = np.diff(cumulative[:, i])
        log_q += np.log(mass[cell] / (CELLS[1] - CELLS[0]))
    return z, log_q
