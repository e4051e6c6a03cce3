"""An independence proposal fitted to the posterior: a mixture of multivariate Student-t densities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from emcee.moves import MHMove
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

FREEDOM = 8.0
"""Degrees of freedom: heavier tails than any posterior here, so that no tail is left out."""
CLOSE_FREEDOM = 20.0
"""The same for components that were fitted to many draws; others beside them cover the tails."""
EM_ROUNDS = 25
PULL = 0.002
"""Share of all draws that counts towards each component, as if the mean component held it."""


@dataclass(frozen=True)
class StudentMixture:
    """``means`` (K, d), Cholesky factors ``roots`` (K, d, d) and ``shares`` (K,) that add up to one.

    ``freedom``: each component's degrees of freedom, or those of all.
    """

    means: Array
    roots: Array
    shares: Array
    freedom: tuple[float, ...] = (FREEDOM,)

    @staticmethod
    def build(
        means: list[Array],
        covariances: list[Array],
        shares: Array | None = None,
        freedom: tuple[float, ...] = (FREEDOM,),
    ) -> StudentMixture:
        """From means (d,), covariances (d, d) and shares, equal where they are not given."""
        weights = np.ones(len(means)) if shares is None else shares
        roots = np.linalg.cholesky(np.stack(covariances))
        return StudentMixture(np.stack(means), roots, weights / weights.sum(), freedom)

    def draw(self, n: int, rng: np.random.RandomState, widen: float = 1.0) -> Array:
        """n points (n, d); ``widen`` multiplies the scale."""
        which = rng.choice(len(self.means), size=n, p=self.shares)
        freedom = np.broadcast_to(self.freedom, self.shares.shape)[which, None]
        z = rng.standard_normal((n, self.means.shape[1])) / np.sqrt(rng.chisquare(freedom) / freedom)
        return np.asarray(self.means[which] + widen * np.einsum("nij,nj->ni", self.roots[which], z))

    def log_density(self, x: Array) -> Array:
        """Log density (n,) at points (n, d)."""
        d = x.shape[1]
        delta = x[:, None, :] - self.means
        whitened = np.linalg.inv(self.roots) @ np.moveaxis(delta, 0, -1)
        square = np.sum(whitened**2, axis=1).T
        log_det = np.sum(np.log(np.diagonal(self.roots, axis1=1, axis2=2)), axis=1)
        v = np.broadcast_to(self.freedom, self.shares.shape)
        norm = special.gammaln((v + d) / 2) - special.gammaln(v / 2) - d / 2 * np.log(v * np.pi)
        each = norm - log_det - (v + d) / 2 * np.log1p(square / v)
        return np.asarray(np.logaddexp.reduce(each + np.log(self.shares), axis=1))


def fit_normals(x: Array, weight: Array, count: int) -> tuple[list[Array], list[Array], Array]:
    """Means, covariances and shares of ``count`` normal densities that together fit weighted draws (n, d).

    Expectation-maximisation, begun at draws that lie far from each other (Arthur and Vassilvitskii 2007,
    k-means++). Each covariance is drawn a little to the mean of all components', so that none collapses; that
    of all draws would be far too wide for pieces of a bent ridge.
    """
    centre = weight @ x
    whole = (x - centre).T @ ((x - centre) * weight[:, None]) + 1e-10 * np.eye(x.shape[1])
    if count == 1:
        return [centre], [whole], np.ones(1)
    white = np.linalg.solve(np.linalg.cholesky(whole), (x - centre).T).T
    own = weight * _near_distant_draws(white, weight, count)
    within = whole
    for _ in range(EM_ROUNDS):
        shares = own.sum(axis=1)
        means = own @ x / (shares + 1e-12)[:, None]
        delta = x - means[:, None]
        spread = np.swapaxes(delta, 1, 2) @ (delta * own[..., None])
        covariances = (spread + PULL * within) / (shares + PULL)[:, None, None]
        shares = (shares + PULL) / (1.0 + count * PULL)
        within = np.einsum("k,kij->ij", shares, covariances)
        z = np.linalg.inv(np.linalg.cholesky(covariances)) @ np.swapaxes(delta, 1, 2)
        log_det = 0.5 * np.linalg.slogdet(covariances)[1]
        log = np.log(shares)[:, None] - log_det[:, None] - 0.5 * np.sum(z**2, axis=1)
        own = weight * special.softmax(log, axis=0)
    return list(means), list(covariances), shares


def _near_distant_draws(white: Array, weight: Array, count: int) -> Array:
    """Which of ``count`` draws each of the whitened ones (n, d) is next to: 0 or 1, (count, n)."""
    rng = np.random.RandomState(0)
    away = np.empty((count, len(white)))
    chance = weight
    for k in range(count):
        chosen = white[rng.choice(len(white), p=chance / chance.sum())]
        away[k] = np.sum((white - chosen) ** 2, axis=1)
        chance = weight * away[: k + 1].min(axis=0)
    nearest: Array = (np.arange(count)[:, None] == away.argmin(axis=0)).astype(np.float64)
    return nearest


def independence_move(mixture: StudentMixture) -> MHMove:
    """emcee's Metropolis-Hastings move with a proposal that does not look at where a walker is."""

    def propose(x: Array, rng: np.random.RandomState) -> tuple[Array, Array]:
        q = mixture.draw(len(x), rng)
        return q, mixture.log_density(x) - mixture.log_density(q)

    return MHMove(propose)
