"""The evidence by quadrature: Laplace's Gaussian gives the axes, the density itself what is integrated.

Laplace's approximation is off by tenths of a nat where a mode lies near a bound: the image u of a
half-normal or log-normal parameter then has a long flat tail to -∞. One dimension is integrated as it is.
In more, the density is followed along each axis of the mode's ellipsoid, and the product of these profiles
is the importance density of a randomised quasi-Monte Carlo rule. Where its weights are uneven, the axes are
bent first: along the widest coordinate the others are led along the density's own ridge (nested Laplace).

Only the one mode is integrated, and what is narrow and far off the axes can be missed (0.03 to 0.28 nats on
ridges of two rates that three levels hardly tell apart); ``error`` says how far independent randomisations of
the rule differ, no more. In ten dimensions along curved ridges the rule does not
settle: the error then says so (``Evidence.reliable``), and Laplace's figure is the better one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import interpolate, special
from scipy.stats import qmc

from mpam_calib.posterior.mode import Density, Mode, evaluate

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
TEMPER, TEMPER_BENT = 0.95, 0.85
"""Power of the profiles, for heavier tails than the density's: straight axes, and bent ones."""
SHIFTS, FIRST, MOST = 4, 16, 256
"""Randomisations of the rule, and points of each: at first, and at most."""
GOOD_SHARE = 0.95
"""Effective share of the first points below which the axes are bent to the density."""
RIDGE_STEP, RIDGE_ROUNDS, WIDEST = 0.3, 3, 4.0
"""Differences (Laplace sds) and rounds in which the ridge is found; bounds of its width and of one step."""
TOLERANCE = 0.008
"""Nats of error at which the rule ends."""
HOPELESS = 0.03
"""Effective share of the first points on bent axes below which no more of them would do."""
RELIABLE = 0.1
"""Error (nats) above which the rule has not settled, and its error is too small itself."""


class Evidence(NamedTuple):
    """ln ∫ p(y|θ) p(θ) dθ (nats), its error, and the posterior's mean (d,) and covariance (d, d)."""

    value: float
    error: float
    mean: Array
    covariance: Array

    @property
    def reliable(self) -> bool:
        """Whether the randomisations agree well enough for the figure to be used."""
        return bool(np.isfinite(self.value) and self.error <= RELIABLE)


def integrate(density: Density, mode: Mode, seed: int = 0) -> Evidence:
    """Evidence of the density around a mode; ``seed`` randomises the rule (dimensions above one)."""
    d = len(mode.u)
    if d == 0:
        return Evidence(mode.log_posterior, 0.0, mode.u, mode.covariance)
    if d == 1:
        return _line(density, mode.u, float(np.sqrt(mode.covariance[0, 0])))
    axes = Axes.straight(mode)
    rule = _Rule(density, axes, seed, TEMPER)
    rule.extend(FIRST)
    if rule.share < GOOD_SHARE:
        rule = _Rule(density, axes.bent(density), seed, TEMPER_BENT)
        rule.extend(FIRST)
    while rule.share > HOPELESS and rule.evidence()[1] > TOLERANCE and rule.count < MOST:
        rule.extend(rule.count)
    return Evidence(*rule.evidence(), *rule.moments())


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
    u = centre + sd * z[:, None]
    mean = weight @ u
    return Evidence(value, abs(value - coarse), mean, (u - mean).T @ ((u - mean) * weight[:, None]))


@dataclass(frozen=True)
class Axes:
    """Where whitened coordinates z (n, d) lie: u = centre + root·(z₁, shift(z₁) + scale(z₁)·z₂...).

    The first axis is that of the widest coordinate; ``ridge`` holds the others' shift and log scale, twice
    (d − 1), at NODES of the first.
    """

    centre: Array
    root: Array
    ridge: Array

    @staticmethod
    def straight(mode: Mode) -> Axes:
        """Laplace's: where the widest goes, the regression on it takes the others along."""
        d = len(mode.u)
        order = np.argsort(-np.diag(mode.covariance), kind="stable")
        root = np.empty((d, d))
        root[order] = np.linalg.cholesky(mode.covariance[np.ix_(order, order)])
        return Axes(mode.u, root, np.zeros((len(NODES), 2 * (d - 1))))

    def bent(self, density: Density) -> Axes:
        """The same with the others at their best, and as wide as the density there, along the first."""
        others = len(self.centre) - 1
        offsets = RIDGE_STEP * np.concatenate([np.zeros((1, others)), np.eye(others), -np.eye(others)])
        shift = np.zeros((len(NODES), others))
        scale = np.ones((len(NODES), others))
        for _ in range(RIDGE_ROUNDS):
            z = np.empty((len(NODES), len(offsets), others + 1))
            z[:, :, 0] = NODES[:, None]
            z[:, :, 1:] = shift[:, None] + offsets
            f = evaluate(density, self.centre + z.reshape(-1, others + 1) @ self.root.T)
            f = np.nan_to_num(f.reshape(len(NODES), -1), neginf=-1e9)
            slope = (f[:, 1 : others + 1] - f[:, others + 1 :]) / (2.0 * RIDGE_STEP)
            bend = (2.0 * f[:, :1] - f[:, 1 : others + 1] - f[:, others + 1 :]) / RIDGE_STEP**2
            scale = 1.0 / np.sqrt(np.clip(bend, 1.0 / WIDEST**2, WIDEST**2))
            shift = shift + np.clip(slope * scale**2, -WIDEST * scale, WIDEST * scale)
        return replace(self, ridge=np.concatenate([shift, np.log(scale)], axis=1))

    def place(self, z: Array) -> tuple[Array, Array]:
        """Points u (n, d), and the logarithm (n,) of the volume of a unit of z there."""
        at = np.clip(z[:, 0], NODES[0], NODES[-1])
        shift, log_scale = np.split(interpolate.pchip_interpolate(NODES, self.ridge, at), 2, axis=1)
        turned = np.concatenate([z[:, :1], shift + np.exp(log_scale) * z[:, 1:]], axis=1)
        size = np.linalg.slogdet(self.root)[1] + log_scale.sum(axis=1)
        return self.centre + turned @ self.root.T, size


class _Rule:
    """Importance sampling by randomised Sobol' points in the product of the profiles along the axes."""

    def __init__(self, density: Density, axes: Axes, seed: int, temper: float) -> None:
        d = len(axes.centre)
        self.density, self.axes = density, axes
        u, log_size = axes.place((NODES[:, None, None] * np.eye(d)).reshape(-1, d))
        self.cumulative = _profiles((evaluate(density, u) + log_size).reshape(len(NODES), d), temper)
        self.engines = [qmc.Sobol(d, rng=np.random.default_rng([seed, k])) for k in range(SHIFTS)]
        self.points = np.empty((SHIFTS, 0, d))
        self.log_weights = np.empty((SHIFTS, 0))

    @property
    def count(self) -> int:
        """Points of each randomisation."""
        return self.points.shape[1]

    def extend(self, count: int) -> None:
        """Add points to each randomisation."""
        shares = np.concatenate([engine.random(count) for engine in self.engines])
        z, log_q = _place(self.cumulative, shares)
        u, log_size = self.axes.place(z)
        log_w = evaluate(self.density, u) - log_q + log_size
        self.points = np.concatenate([self.points, u.reshape(SHIFTS, count, -1)], axis=1)
        self.log_weights = np.concatenate([self.log_weights, log_w.reshape(SHIFTS, count)], axis=1)

    @property
    def weights(self) -> Array:
        """Normalised weights of all points."""
        flat = self.log_weights.ravel()
        result: Array = np.exp(flat - special.logsumexp(flat))
        return result

    @property
    def share(self) -> float:
        """Effective share of the points."""
        return float(1.0 / np.sum(self.weights**2) / self.weights.size)

    def evidence(self) -> tuple[float, float]:
        """Log evidence and its error from the randomisations' scatter."""
        each = special.logsumexp(self.log_weights, axis=1) - np.log(self.count)
        value = float(special.logsumexp(each) - np.log(SHIFTS))
        return value, float(np.exp(each - value).std(ddof=1) / np.sqrt(SHIFTS))

    def moments(self) -> tuple[Array, Array]:
        """Mean (d,) and covariance (d, d) of the weighted points."""
        u = self.points.reshape(-1, self.points.shape[2])
        mean = self.weights @ u
        return mean, (u - mean).T @ ((u - mean) * self.weights[:, None])


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
