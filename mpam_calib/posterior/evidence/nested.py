"""Nested Laplace: a few wide coordinates are drawn, all others follow them and are integrated around there.

A posterior bends where the data leave one or two coordinates wide and hold the rest tightly given these, as
with rates that few pressure levels tell apart. Given the wide ones (z) the density of the others (y) is a
narrow Gaussian around a mode y(z) that Newton steps find for many z at once (Rue, Martino and Chopin 2009,
doi:10.1111/j.1467-9868.2008.00700.x). Here that Gaussian only places the others' points: each counts with
its weight, so that the integral is exact but for its scatter. What z is drawn from is refitted round by
round, and all rounds' points count (Cornuet and others 2012, doi:10.1111/j.1467-9469.2011.00756.x).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats
from scipy.stats import qmc

from mpam_calib.posterior.chains.proposal import StudentMixture, fit_normals
from mpam_calib.posterior.density.mode import Density, Mode, evaluate

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

WIDE, MOST_WIDE = 0.5, 4
"""Sd given the wider ones from which a coordinate is wide (the prior's is 1), and their largest number."""
SHIFTS, POINTS, ROUNDS = 8, 32, 6
"""Randomisations of a round, points of each, and rounds at most."""
ENOUGH = 0.015
"""Error (nats) at which the rounds end."""
SPREAD, INFLATION, COMPONENTS = 1.5, 1.1, 2
"""Width of the first round in Laplace's, of others in the weighted points'; normals fitted to these."""
FREEDOM = 8.0
"""Degrees of freedom of the others' points along their axes."""
REACH, FURTHEST = 0.5, 40.0
"""Differences and longest step of Newton's method, in sds of the others."""
FLATTEST = 1.0 / 9.0
"""Least curvature that is believed, in that of the round before."""
STEPS, SHORTER = 10, 0.3
"""Newton steps at most; by how much one that led downhill is shortened."""
SETTLED, ADRIFT = 0.01, 0.3
"""Nats that the next step promises where the steps end, and from which its promise is not believed."""
BEYOND = 1e-9
"""Shares of a distribution that are not drawn from, at either end."""


class Weighted(NamedTuple):
    """Points (s, n, d) of s independent randomisations with the logarithms (s, n) of their weights."""

    points: Array
    log_weights: Array


class Followed(NamedTuple):
    """Where the others settled: ``mode`` (n, k), covariance's ``root`` (n, k, k), log ∫ (n,) over them."""

    mode: Array
    root: Array
    log_marginal: Array


def weigh_nested(density: Density, mode: Mode, seed: int) -> Weighted:
    """Weighted points of the density around a mode."""
    nested = Nested(density, mode)
    rng = np.random.default_rng([seed, 11])
    drawn = [StudentMixture.build([mode.u[nested.wide]], [SPREAD**2 * nested.own])]
    known: Followed | None = None
    z, points, log_p, marginal = np.empty((0, len(nested.wide))), [], [], np.empty(0)
    while True:
        shares = np.concatenate([qmc.Sobol(len(mode.u) + 2, rng=rng).random(POINTS) for _ in range(SHIFTS)])
        shares = np.clip(shares, BEYOND, 1.0 - BEYOND)
        new = place(drawn[-1], shares[:, : len(nested.wide) + 2])
        found = nested.follow(new, z, known)
        u, weight = nested.draw(new, found, shares[:, len(nested.wide) + 2 :])
        z, marginal = np.concatenate([z, new]), np.concatenate([marginal, found.log_marginal])
        known = found if known is None else Followed(*map(np.concatenate, zip(known, found, strict=True)))
        points.append(u.reshape(SHIFTS, POINTS, -1))
        log_p.append(weight)
        log_q = np.logaddexp.reduce([q.log_density(z) for q in drawn]) - np.log(len(drawn))
        log_weights = (np.concatenate(log_p) - log_q).reshape(-1, SHIFTS, POINTS)
        weighted = Weighted(np.concatenate(points, axis=1), np.concatenate(list(log_weights), axis=1))
        settled = len(drawn) > 1 and scatter(weighted.log_weights)[1] < ENOUGH
        if settled or len(drawn) == ROUNDS:
            return weighted
        drawn.append(_fitted(z, special.softmax(marginal - log_q)))


def scatter(log_weights: Array) -> tuple[float, float]:
    """Log integral and its error from the scatter of independent randomisations (s, n)."""
    each = special.logsumexp(log_weights, axis=1) - np.log(log_weights.shape[1])
    value = float(special.logsumexp(each) - np.log(len(each)))
    return value, float(np.exp(each - value).std(ddof=1) / np.sqrt(len(each)))


class Nested:
    """The coordinates of a density parted into wide ones and those that follow them."""

    def __init__(self, density: Density, mode: Mode) -> None:
        self.density, self.mode = density, mode
        self.wide = _widest(mode.covariance)
        self.others = np.setdiff1d(np.arange(len(mode.u)), self.wide)
        self.own = mode.covariance[np.ix_(self.wide, self.wide)]
        self.gain = np.linalg.solve(self.own, mode.covariance[np.ix_(self.wide, self.others)])
        rest = mode.covariance[np.ix_(self.others, self.others)]
        self.root = np.linalg.cholesky(rest - mode.covariance[np.ix_(self.others, self.wide)] @ self.gain)
        k = len(self.others)
        self.pairs = np.triu_indices(k, 1)
        e = np.eye(k)
        both = e[self.pairs[0]] + e[self.pairs[1]]
        self.offsets = REACH * np.concatenate([np.zeros((1, k)), e, -e, both, -both])

    def _at(self, z: Array, y: Array) -> Array:
        u = np.empty((len(z), len(self.mode.u)))
        u[:, self.wide], u[:, self.others] = z, y
        return evaluate(self.density, u)

    def follow(self, z: Array, before: Array, known: Followed | None) -> Followed:
        """The others' modes at z (n, w), found from Laplace's regression or from what is ``known`` nearby."""
        n, k = len(z), len(self.others)
        if k == 0:
            return Followed(np.empty((n, 0)), np.empty((n, 0, 0)), self._at(z, np.empty((n, 0))))
        if known is None:
            y = self.mode.u[self.others] + (z - self.mode.u[self.wide]) @ self.gain
            root = np.repeat(self.root[None], n, axis=0)
        else:
            y, root = self._from_nearby(z, before, known)
        best = np.full(n, -np.inf)
        at, found, step, promise = y.copy(), root.copy(), np.zeros((n, k)), np.full(n, np.inf)
        for _ in range(STEPS):
            on = np.flatnonzero(promise > SETTLED)
            if not len(on):
                break
            tried = at[on] + step[on]
            top, slope, root = self._shape(z[on], tried, found[on])
            better = top > best[on]
            up = on[better]
            # Along the new axes the curvature is one: the slope is the step, and half its square the promise.
            length = np.linalg.norm(slope[better], axis=1)
            shortened = np.minimum(1.0, FURTHEST / np.maximum(length, 1e-300))
            best[up], at[up], found[up] = top[better], tried[better], root[better]
            promise[up] = 0.5 * length**2
            step[up] = shortened[:, None] * np.einsum("nij,nj->ni", root[better], slope[better])
            down = on[~better]
            step[down] *= SHORTER
            promise[down] *= SHORTER
        near = promise < ADRIFT
        at = at + np.where(near[:, None], step, 0.0)
        size = np.linalg.slogdet(found)[1] + 0.5 * k * np.log(2.0 * np.pi)
        return Followed(at, found, best + np.where(near, promise, 0.0) + size)

    def _shape(self, z: Array, y: Array, root: Array) -> tuple[Array, Array, Array]:
        """Density (n,), slopes (n, k) along axes of curvature one, and these (n, k, k)."""
        n, k = y.shape
        points = y[:, None] + np.einsum("nij,mj->nmi", root, self.offsets)
        f = self._at(np.repeat(z, len(self.offsets), axis=0), points.reshape(-1, k)).reshape(n, -1)
        f = np.nan_to_num(f, neginf=-1e9)
        top, up, down = f[:, 0], f[:, 1 : k + 1], f[:, k + 1 : 2 * k + 1]
        both = f[:, 2 * k + 1 :].reshape(n, 2, -1).sum(axis=1)
        i, j = self.pairs
        single = up + down - 2.0 * top[:, None]
        hessian = single[:, :, None] * np.eye(k)
        hessian[:, i, j] = 0.5 * (both - 2.0 * top[:, None] - single[:, i] - single[:, j])
        hessian[:, j, i] = hessian[:, i, j]
        values, turns = np.linalg.eigh(-hessian / REACH**2)
        axes = turns / np.sqrt(np.maximum(values, FLATTEST))[:, None, :]
        slope = np.einsum("nji,nj->ni", axes, (up - down) / (2.0 * REACH))
        return top, slope, root @ axes

    def _from_nearby(self, z: Array, before: Array, known: Followed) -> tuple[Array, Array]:
        """The plane through the modes that are known near z (n, w), and the nearest one's axes."""
        w = z.shape[1]
        white = np.linalg.inv(np.linalg.cholesky(self.own)).T
        away = np.sum((z[:, None] @ white - before @ white) ** 2, axis=2)
        nearest = np.argsort(away, axis=1, kind="stable")[:, : 3 * (w + 1)]
        delta = (before[nearest] - z[:, None]) @ white
        X = np.concatenate([np.ones((*delta.shape[:2], 1)), delta], axis=2)
        across = np.swapaxes(X, 1, 2)
        square = across @ X + 1e-6 * np.eye(w + 1)
        y = np.linalg.solve(square, across @ known.mode[nearest])[:, 0]
        return y, known.root[nearest[:, 0]]

    def draw(self, z: Array, found: Followed, shares: Array) -> tuple[Array, Array]:
        """Points u (n, d) at these shares (n, k) of the others' axes, and ln p − ln q (n,) given z."""
        t = stats.t.ppf(shares, FREEDOM)
        u = np.empty((len(z), len(self.mode.u)))
        u[:, self.wide] = z
        u[:, self.others] = found.mode + np.einsum("nij,nj->ni", found.root, t)
        log_q = stats.t.logpdf(t, FREEDOM).sum(axis=1) - np.linalg.slogdet(found.root)[1]
        return u, evaluate(self.density, u) - log_q


def _widest(covariance: Array) -> Ints:
    """Coordinates that stay wide given the wider ones, widest first; at least one."""
    left = covariance.copy()
    chosen: list[int] = []
    while len(chosen) < min(len(covariance), MOST_WIDE):
        sizes = np.diagonal(left).copy()
        sizes[chosen] = -1.0
        i = int(sizes.argmax())
        if chosen and sizes[i] < WIDE**2:
            break
        chosen.append(i)
        left = left - np.outer(left[:, i], left[i]) / left[i, i]
    return np.array(chosen)


def _fitted(z: Array, weight: Array) -> StudentMixture:
    effective = 1.0 / float(np.sum(weight**2))
    count = COMPONENTS if effective > 10 * COMPONENTS * z.shape[1] else 1
    means, covariances, shares = fit_normals(z, weight, count)
    return StudentMixture.build(means, [INFLATION**2 * c for c in covariances], shares)


def place(mixture: StudentMixture, shares: Array) -> Array:
    """Points (n, w) of a mixture at shares (n, 2 + w): of its components, of their widths, along axes."""
    which = np.searchsorted(np.cumsum(mixture.shares)[:-1], shares[:, 0])
    freedom = np.broadcast_to(mixture.freedom, mixture.shares.shape)[which]
    wide = np.sqrt(freedom / stats.chi2.ppf(shares[:, 1], freedom))
    normal = wide[:, None] * special.ndtri(shares[:, 2:])
    return np.asarray(mixture.means[which] + np.einsum("nij,nj->ni", mixture.roots[which], normal))
