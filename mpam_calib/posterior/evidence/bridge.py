"""The evidence by bridge sampling, with its error: a check on the quadrature that shares little with it.

Draws of the posterior and draws of a fitted density q are joined by Meng and Wong's optimal bridge
(1996, Statistica Sinica 6:831); the error is Frühwirth-Schnatter's (2004, Econometrics Journal 7:143).
A q that misses part of the posterior shows as a large error: hardly a draw of it is as likely under q.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from emcee.autocorr import integrated_time
from numpy.typing import NDArray
from scipy import special

from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.density.mode import Density, evaluate
from mpam_calib.posterior.evidence.quadrature import Evidence, settled

Array = NDArray[np.float64]

DRAWS, MORE = 1000, 4
"""Proposed draws of the posterior, half of which fit q, and about as many draws of q as the other half; and
times as many where these do not do: of two hills, few are draws of both."""
BURN = 0.1
INFLATION = 1.15
ROUNDS = 100


class Bridge(NamedTuple):
    """Log evidence and its standard error, nats."""

    value: float
    error: float

    @property
    def reliable(self) -> bool:
        """Whether the two sets of draws overlap enough for the error to mean anything."""
        return settled(self.value, self.error)


def bridge_evidence(density: Density, found: Evidence, seed: int) -> Bridge:
    """Bridge sampling of a density whose mean and covariance are about known."""
    if len(found.mean) == 0:
        return Bridge(found.value, 0.0)
    first = _bridge_once(density, found, seed, DRAWS)
    return first if first.reliable else _bridge_once(density, found, seed, MORE * DRAWS)


def _bridge_once(density: Density, found: Evidence, seed: int, draws: int) -> Bridge:
    rng = np.random.RandomState(np.random.SeedSequence([seed, 4]).generate_state(1)[0])
    wide = StudentMixture.build([found.mean], [INFLATION**2 * found.covariance])
    chain, log_p = independence_chain(density, wide, draws, rng)
    half = len(chain) // 2
    return bridge(density, chain[half:], log_p[half:], fitted(chain[:half]), rng)


def fitted(draws: Array) -> StudentMixture:
    """A Student-t density with the mean and covariance of draws (n, d)."""
    d = draws.shape[1]
    covariance = np.atleast_2d(np.cov(draws.T)) + 1e-12 * np.eye(d)
    return StudentMixture.build([draws.mean(axis=0)], [covariance])


def independence_chain(
    density: Density, proposal: StudentMixture, draws: int, rng: np.random.RandomState
) -> tuple[Array, Array]:
    """Metropolis-Hastings with proposals that do not look at where the chain is: draws (n, d), log density.

    All proposals are evaluated at once; the first tenth is left out.
    """
    proposed = proposal.draw(draws, rng)
    log_p = evaluate(density, proposed)
    log_weight = log_p - proposal.log_density(proposed)
    threshold = np.log(rng.random_sample(draws))
    kept = np.zeros(draws, dtype=np.int64)
    at = int(np.argmax(np.isfinite(log_weight)))
    for i in range(draws):
        if log_weight[i] - log_weight[at] > threshold[i]:
            at = i
        kept[i] = at
    kept = kept[int(BURN * draws) :]
    return proposed[kept], log_p[kept]


def bridge(
    density: Density, draws: Array, log_p: Array, q: StudentMixture, rng: np.random.RandomState
) -> Bridge:
    """Bridge between draws (n, d) of a density, with its log values (n,) there, and as many draws of q."""
    from_q = q.draw(len(draws), rng)
    at_draws = log_p - q.log_density(draws)
    at_q = evaluate(density, from_q) - q.log_density(from_q)
    size = _effective(at_draws)
    log_s1, log_s2 = np.log(size / (size + len(from_q))), np.log(len(from_q) / (size + len(from_q)))

    def terms(value: float) -> tuple[Array, Array]:
        """ln p/(s₁p + s₂q) at q's draws, and ln q/(s₁p + s₂q) at p's, with p normalised by exp(value)."""
        over, under = at_q - value, at_draws - value
        return over - np.logaddexp(log_s1 + over, log_s2), -np.logaddexp(log_s1 + under, log_s2)

    value = float(np.median(at_draws))
    for _ in range(ROUNDS):
        f1, f2 = terms(value)
        step = float(_log_mean(f1) - _log_mean(f2))
        value += step
        if not np.isfinite(value) or abs(step) < 1e-10:
            break
    if not np.isfinite(value):
        return Bridge(float("nan"), float("inf"))
    f1, f2 = (np.exp(f - f.max()) for f in terms(value))
    square = f1.var() / f1.mean() ** 2 / len(f1) + f2.var() / f2.mean() ** 2 / _effective(f2)
    return Bridge(value, float(np.sqrt(square)))


def _log_mean(x: Array) -> float:
    return float(special.logsumexp(x) - np.log(len(x)))


def _effective(x: Array) -> float:
    """Effective size of a series (n,) of a chain."""
    if np.ptp(x) == 0.0:
        return 1.0
    return len(x) / max(float(integrated_time(x, quiet=True, tol=0)[0]), 1.0)
