"""The evidence of a law whose moduli have rates of their own: a density of these rates alone, integrated.

Given the rates everything else is a Gaussian, and integrated out of what the moduli free at each level say
(:mod:`mpam_calib.criticism.selection.rates`). What is left costs a twentieth of the model's density, so
that some ten thousand draws find their way through its many dimensions. That Gaussian is the free moduli's
own Laplace approximation; some of the draws, completed by sizes and weighed by the model's density, correct
it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import log

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.criticism.fitting.hypothesis import HARSHEST, Hypothesis
from mpam_calib.criticism.selection.rates import Rates
from mpam_calib.posterior.chains.effective import effective_share
from mpam_calib.posterior.density.mode import Mode, evaluate
from mpam_calib.posterior.evidence.adaptive import error_of, weigh_adaptively
from mpam_calib.posterior.evidence.quadrature import Evidence
from mpam_calib.posterior.likelihood.algebra import LOG_2PI

Array = NDArray[np.float64]

COMPLETED, ALIKE = 1000, 0.02
"""Draws that correct the Gaussian, and their effective share below which it is too far off for that."""


@dataclass(frozen=True)
class RatesAlone:
    """ln ∫ p(y, u, η | ρ) du dη + ln p(ρ) as a density of the rates ρ, all other sizes u Gaussian."""

    target: Rates

    @cached_property
    def _moduli_seen(self) -> tuple[Array, Array, float]:
        """What is seen of free moduli: columns (q, L·order), data (q,), and a constant (nats)."""
        seen, data = self.target.seen
        d = len(self.target.fit.u)
        sizes, moduli = seen[:, :d], seen[:, d:]
        root = np.linalg.cholesky(np.eye(len(seen)) + sizes @ sizes.T)
        white = np.linalg.solve(root, data)
        turn, columns = np.linalg.qr(np.linalg.solve(root, moduli))
        kept = turn.T @ white
        missed = float(white @ white - kept @ kept)
        constant = self.target.offset - 0.5 * missed - float(np.sum(np.log(np.diagonal(root))))
        return columns, kept, constant

    def log_posterior(self, rates: Array) -> Array:
        """Log density (B,) of rates (B, r); -∞ where they are too far out for the priors to be seen."""
        columns, data, constant = self._moduli_seen
        X = columns @ self.target.moduli(rates)
        sound = np.sum(X**2, axis=(1, 2)) < HARSHEST
        X = np.where(sound[:, None, None], X, 0.0)
        across = np.swapaxes(X, 1, 2)
        root = np.linalg.cholesky(across @ X + np.eye(X.shape[2]))
        explained = np.linalg.solve(root, (across @ data)[..., None])[..., 0]
        quadratic = data @ data - np.sum(explained**2, axis=1) + np.sum(rates**2 + LOG_2PI, axis=1)
        result: Array = constant - 0.5 * quadratic - np.sum(np.log(np.einsum("bii->bi", root)), axis=1)
        return np.where(sound, result, -np.inf)

    def others(self, rates: Array, rng: np.random.RandomState) -> tuple[Array, Array]:
        """Draws (B, d) of the other sizes given rates (B, r), and their log densities (B,)."""
        place, d = self.target.look(rates), len(self.target.fit.u)
        X = place.columns
        covariance = np.linalg.inv(np.swapaxes(X, 1, 2) @ X + np.eye(X.shape[2]))[:, :d, :d]
        root, z = np.linalg.cholesky(covariance), rng.standard_normal((len(rates), d))
        log_q = -0.5 * np.sum(z**2 + LOG_2PI, axis=1) - np.sum(np.log(np.einsum("bii->bi", root)), axis=1)
        return place.coordinates[:, :d] + np.einsum("bij,bj->bi", root, z), log_q


def integrate_rates(target: Rates, hypothesis: Hypothesis, mode: Mode, seed: int = 0) -> Evidence | None:
    """Evidence of the hypothesis about its mode; None where the free moduli's Gaussian is too far off."""
    rng = np.random.RandomState(np.random.SeedSequence([seed, 13]).generate_state(1)[0])
    alone, names = RatesAlone(target), [p.name for p in hypothesis.parameters]
    own, other = ([names.index(name) for name in some] for some in (target.names, target.fit.names))
    top = float(alone.log_posterior(mode.u[None, own])[0])
    start = Mode(mode.u[own], top, mode.covariance[np.ix_(own, own)])
    rounds, error = weigh_adaptively(alone, start, rng)
    rates = rounds.drawn[rng.choice(len(rounds.drawn), COMPLETED, p=rounds.weight)]
    u = np.empty((COMPLETED, len(names)))
    u[:, own] = rates
    u[:, other], log_q = alone.others(rates, rng)
    log_weight = evaluate(hypothesis, u) - log_q - alone.log_posterior(rates)
    if not effective_share(log_weight) >= ALIKE:
        return None
    return Evidence.of_points(
        rounds.log_integral + float(special.logsumexp(log_weight)) - log(COMPLETED),
        float(np.hypot(error, error_of(log_weight))),
        u,
        special.softmax(log_weight),
    )
