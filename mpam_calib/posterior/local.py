"""Follow a density wherever it bends: a mixture of many small components, refitted by its own weighted draws.

All rounds' draws are weighed against the mean of all rounds' mixtures (Cornuet and others 2012,
doi:10.1111/j.1467-9469.2011.00756.x): what one of them missed counts from then on.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.posterior.proposal import StudentMixture, fit_local

Array = NDArray[np.float64]

PIECE = 500
"""Points that all components are evaluated at together: more would take hundreds of megabytes."""
BEYOND = 1.5
"""Width of the components while they look beyond what was met, in that of the last round's."""


@dataclass(frozen=True)
class Followed:
    """The last round's mixture, all draws (n, d) and the logarithms (n,) of their weights.

    ``share`` is the effective share of the last round's draws under its own mixture.
    """

    mixture: StudentMixture
    drawn: Array
    log_weight: Array
    share: float

    @property
    def weight(self) -> Array:
        """The draws' weights, adding up to one."""
        return np.exp(self.log_weight - special.logsumexp(self.log_weight))

    @property
    def log_integral(self) -> float:
        """Logarithm of the density's integral."""
        return float(special.logsumexp(self.log_weight) - np.log(len(self.log_weight)))

    @property
    def error(self) -> float:
        """Standard error of the same (nats)."""
        return float(np.sqrt(max(np.sum(self.weight**2) - 1.0 / len(self.weight), 0.0)))


def follow(
    log_density: Callable[[Array], Array],
    x: Array,
    weight: Array,
    rounds: int,
    draws: int,
    rng: np.random.RandomState,
) -> Followed:
    """Begin at weighted points x (n, d), and look beyond them round by round."""
    mixtures: list[StudentMixture] = []
    drawn, log_p = np.empty((0, x.shape[1])), np.empty(0)
    for number in range(rounds):
        mixtures.append(fit_local(x, weight, rng, BEYOND if number < rounds - 1 else 1.0))
        new = mixtures[-1].draw(draws, rng)
        own = log_density(new)
        drawn, log_p = np.concatenate([drawn, new]), np.concatenate([log_p, own])
        log_q = np.logaddexp.reduce([_log_density(m, drawn) for m in mixtures]) - np.log(len(mixtures))
        x, weight = drawn, special.softmax(log_p - log_q)
    share = effective_share(own - _log_density(mixtures[-1], new))
    return Followed(mixtures[-1], drawn, log_p - log_q, share)


def _log_density(mixture: StudentMixture, x: Array) -> Array:
    return np.concatenate([mixture.log_density(x[i : i + PIECE]) for i in range(0, len(x), PIECE)])


def effective_share(log_weight: Array) -> float:
    """Effective share of draws with these weights (Kish)."""
    return float(1.0 / np.sum(special.softmax(log_weight) ** 2) / len(log_weight))
