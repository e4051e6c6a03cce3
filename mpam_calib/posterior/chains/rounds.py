"""Weighted draws in rounds, each from a proposal of its own, weighed against the mixture of all of them.

Cornuet and others 2012, doi:10.1111/j.1467-9469.2011.00756.x: a draw's weight does not depend on the round
that it comes from, so that a proposal which misses a place takes nothing from the draws that others have
there.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.posterior.chains.proposal import StudentMixture

Array = NDArray[np.float64]

Evaluate = Callable[[Array], Array]
"""The log posterior (n,) of many points (n, d)."""
HOPELESS = -1e30
"""Log density of impossible points."""


class Rounds:
    """All rounds' draws (n, d), the log posterior (n,) there, and the expected log number per volume (n,)."""

    def __init__(self, dimensions: int) -> None:
        self.count = 0
        self.drawn = np.empty((0, dimensions))
        self.log_p, self.log_number = np.empty(0), np.empty(0)
        self._mixtures: list[tuple[StudentMixture, float]] = []

    def draw(
        self, mixture: StudentMixture, count: int, evaluate: Evaluate, rng: np.random.RandomState
    ) -> Array:
        """Another round; its draws' log weights (count,) under its own mixture alone."""
        x = mixture.draw(count, rng)
        log_p = np.maximum(np.nan_to_num(evaluate(x), nan=HOPELESS), HOPELESS)
        own = mixture.log_density(x)
        old = np.logaddexp(self.log_number, mixture.log_density(self.drawn) + np.log(count))
        self._mixtures.append((mixture, np.log(count)))
        new = [own if each is mixture else each.log_density(x) for each, _ in self._mixtures]
        number = np.logaddexp.reduce([q + n for q, (_, n) in zip(new, self._mixtures, strict=True)])
        self.drawn = np.concatenate([self.drawn, x])
        self.log_p = np.concatenate([self.log_p, log_p])
        self.log_number = np.concatenate([old, number])
        self.count += 1
        return np.asarray(log_p - own)

    @property
    def weight(self) -> Array:
        """Weights (n,) of all draws, adding up to one."""
        return np.asarray(special.softmax(self.log_p - self.log_number))

    @property
    def log_integral(self) -> float:
        """Logarithm of the posterior density's integral: the log evidence (nats)."""
        return float(special.logsumexp(self.log_p - self.log_number))

    def covered(self, mixture: StudentMixture) -> float:
        """Effective share that draws of this mixture would have, as all rounds' draws tell."""
        log_weight = self.log_p - self.log_number
        ratio = self.log_p - mixture.log_density(self.drawn) - self.log_integral
        return float(np.exp(self.log_integral - special.logsumexp(log_weight + ratio)))
