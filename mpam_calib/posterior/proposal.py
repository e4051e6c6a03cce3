"""An independence proposal fitted to the posterior: a mixture of multivariate Student-t densities."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from emcee.moves import MHMove
from numpy.typing import NDArray
from scipy import special

Array = NDArray[np.float64]

FREEDOM = 6.0
"""Degrees of freedom: heavier tails than any posterior here, so that no tail is left out."""


@dataclass(frozen=True)
class StudentMixture:
    """Equal-weight mixture: ``means`` (K, d) and Cholesky factors ``roots`` (K, d, d)."""

    means: Array
    roots: Array

    @staticmethod
    def build(means: list[Array], covariances: list[Array]) -> StudentMixture:
        """From means (d,) and covariances (d, d)."""
        return StudentMixture(np.stack(means), np.linalg.cholesky(np.stack(covariances)))

    def draw(self, n: int, rng: np.random.RandomState, widen: float = 1.0) -> Array:
        """n points (n, d); ``widen`` multiplies the scale."""
        which = rng.randint(len(self.means), size=n)
        d = self.means.shape[1]
        z = rng.standard_normal((n, d)) / np.sqrt(rng.chisquare(FREEDOM, size=(n, 1)) / FREEDOM)
        return np.asarray(self.means[which] + widen * np.einsum("nij,nj->ni", self.roots[which], z))

    def log_density(self, x: Array) -> Array:
        """Log density (n,) at points (n, d)."""
        d = x.shape[1]
        delta = x[:, None, :] - self.means
        whitened = np.linalg.solve(self.roots, np.moveaxis(delta, 0, -1))
        square = np.sum(whitened**2, axis=1).T
        log_det = np.sum(np.log(np.diagonal(self.roots, axis1=1, axis2=2)), axis=1)
        norm = (
            special.gammaln((FREEDOM + d) / 2)
            - special.gammaln(FREEDOM / 2)
            - d / 2 * np.log(FREEDOM * np.pi)
        )
        each = norm - log_det - (FREEDOM + d) / 2 * np.log1p(square / FREEDOM)
        result: Array = special.logsumexp(each, axis=1) - np.log(len(self.means))
        return result


class IndependenceMove(MHMove):  # type: ignore[misc]
    """emcee's Metropolis-Hastings move with a proposal that does not look at where a walker is."""

    def __init__(self, mixture: StudentMixture) -> None:
        def propose(x: Array, rng: np.random.RandomState) -> tuple[Array, Array]:
            q = mixture.draw(len(x), rng)
            return q, mixture.log_density(x) - mixture.log_density(q)

        super().__init__(propose)
