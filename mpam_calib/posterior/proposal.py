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
PULL = 0.02
"""Share of all draws that counts towards each component."""
LOCAL, LOCAL_FREEDOM = 150, 5.0
"""Components of a mixture that follows a bent posterior, and the degrees of freedom of each."""
NEAREST = 0.1
"""Share of the draws whose covariance is that of a local component."""


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
        whitened = np.linalg.solve(self.roots, np.moveaxis(delta, 0, -1))
        square = np.sum(whitened**2, axis=1).T
        log_det = np.sum(np.log(np.diagonal(self.roots, axis1=1, axis2=2)), axis=1)
        v = np.broadcast_to(self.freedom, self.shares.shape)
        norm = special.gammaln((v + d) / 2) - special.gammaln(v / 2) - d / 2 * np.log(v * np.pi)
        each = norm - log_det - (v + d) / 2 * np.log1p(square / v)
        return np.asarray(np.logaddexp.reduce(each + np.log(self.shares), axis=1))


def fit_normals(x: Array, weight: Array, count: int) -> tuple[list[Array], list[Array], Array]:
    """Means, covariances and shares of ``count`` normal densities that together fit weighted draws (n, d).

    Expectation-maximisation, begun along the axis on which the draws are most askew. Each covariance is
    drawn a little to that of all draws, so that none collapses.
    """
    centre = weight @ x
    whole = (x - centre).T @ ((x - centre) * weight[:, None]) + 1e-10 * np.eye(x.shape[1])
    if count == 1:
        return [centre], [whole], np.ones(1)
    root = np.linalg.cholesky(whole)
    white = np.linalg.solve(root, (x - centre).T).T
    skew = weight @ white**3
    axis = skew / max(float(np.linalg.norm(skew)), 1e-300)
    along = white @ axis
    order = np.argsort(along)
    start = np.interp((np.arange(count) + 0.5) / count, np.cumsum(weight[order]), along[order])
    means = centre + start[:, None] * (root @ axis)
    covariances = np.repeat(whole[None], count, axis=0)
    shares = np.full(count, 1.0 / count)
    for _ in range(EM_ROUNDS):
        roots = np.linalg.cholesky(covariances)
        z = np.linalg.solve(roots, np.swapaxes(x - means[:, None], 1, 2))
        log_det = np.sum(np.log(np.diagonal(roots, axis1=1, axis2=2)), axis=1)
        log = np.log(shares)[:, None] - log_det[:, None] - 0.5 * np.sum(z**2, axis=1)
        own = weight * special.softmax(log, axis=0)
        shares = own.sum(axis=1)
        means = (own @ x + PULL * centre) / (shares + PULL)[:, None]
        delta = x - means[:, None]
        spread = np.swapaxes(delta, 1, 2) @ (delta * own[..., None])
        covariances = (spread + PULL * whole) / (shares + PULL)[:, None, None]
        shares = (shares + PULL) / (1.0 + count * PULL)
    return list(means), list(covariances), shares


def fit_local(x: Array, weight: Array, rng: np.random.RandomState, widen: float = 1.0) -> StudentMixture:
    """A mixture that follows weighted draws (n, d) where they bend: kernels as wide as their surroundings.

    The kernels stand on draws that are chosen by weight; the nearest of all draws give their covariances, and
    ``widen`` multiplies their scale.
    """
    n, d = x.shape
    centre = weight @ x
    whole = (x - centre).T @ ((x - centre) * weight[:, None]) + 1e-10 * np.eye(d)
    white = np.linalg.solve(np.linalg.cholesky(whole), (x - centre).T).T
    chosen = np.searchsorted(np.cumsum(weight), (np.arange(LOCAL) + rng.uniform()) / LOCAL)
    chosen = np.minimum(chosen, n - 1)
    away = np.sum(white**2, axis=1) - 2.0 * white[chosen] @ white.T
    count = min(max(int(NEAREST * n), 10 * d), n)
    nearest = np.argpartition(away, count - 1, axis=1)[:, :count]
    own = weight[nearest]
    # Where a few of the draws have all the weight, the others tell the width as well.
    own = own / own.sum(axis=1, keepdims=True) + 1.0 / count
    own = own / own.sum(axis=1, keepdims=True)
    delta = x[nearest] - np.einsum("kn,knd->kd", own, x[nearest])[:, None]
    spread = np.swapaxes(delta, 1, 2) @ (delta * own[..., None]) + 1e-6 * whole
    return StudentMixture.build(list(x[chosen]), list(widen**2 * spread), freedom=(LOCAL_FREEDOM,))


def independence_move(mixture: StudentMixture) -> MHMove:
    """emcee's Metropolis-Hastings move with a proposal that does not look at where a walker is."""

    def propose(x: Array, rng: np.random.RandomState) -> tuple[Array, Array]:
        q = mixture.draw(len(x), rng)
        return q, mixture.log_density(x) - mixture.log_density(q)

    return MHMove(propose)
