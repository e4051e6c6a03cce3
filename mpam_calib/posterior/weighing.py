"""Adaptive importance sampling: refit a mixture to the posterior by its own weighted draws until it fits.

Laplace's covariance at the modes starts it. Where enough draws carry weight, and none far more than the
others, it is as good as the posterior itself. What a mixture misses of a bent tail, its own draws can fail
to show: it is taken only when many draws look for such a tail and find none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from mpam_calib.posterior.effective import effective_share
from mpam_calib.posterior.mode import Mode
from mpam_calib.posterior.proposal import CLOSE_FREEDOM, FREEDOM, StudentMixture, fit_normals

Array = NDArray[np.float64]

INFLATION = 1.15
RELEVANT = 8.0
"""Modes whose evidence is further below the best (nats) get no component of their own."""
MODES_SHARE, BEYOND = 0.05, 2.5
"""Share of the proposal that stays with the modes, whatever was drawn; by how much wider the draws are
that look beyond what was met."""
LOOKING, TRUSTING = 0.5, 0.1
"""Share of draws that do so in the first rounds from what others met, and in all others."""
MOST_COMPONENTS, DRAWS_EACH = 20, 20
"""Of a mixture that is fitted to draws; effective draws per dimension that each of them asks for."""
FIRST_ROUNDS, ALL_ROUNDS, FIRST_DRAWS = 3, 9, 1000
"""Rounds of few draws that only refit, and all of them; draws of one of the first."""
GOOD_SHARE, HOPELESS = 0.6, 0.3
"""Effective share of weighted draws at which a mixture is good; in two rounds below the other none helps."""
CHECKED, CONFIRMED, FAR_MORE, LIGHT = 3000, 2, 3.0, 0.5
"""Draws that look for a tail which the mixture misses, and how often they must find none; the multiple of
the mean weight from which on one is judged; the largest shape k̂ at which weights have a variance."""

Evaluate = Callable[[Array], Array]
"""The log posterior (n,) of many points (n, d)."""


@dataclass(frozen=True)
class Weighed:
    """A mixture, the effective shares of each round's draws, and whether the last rounds found nothing amiss.

    Where they did the mixture is a refit that nothing was drawn from.
    """

    mixture: StudentMixture
    shares: list[float]
    fits: bool


def laplace_mixture(modes: list[Mode]) -> StudentMixture:
    """The proposal before anything was drawn."""
    return StudentMixture.build(*_components(modes))


def _components(modes: list[Mode]) -> tuple[list[Array], list[Array]]:
    best = max(mode.log_evidence for mode in modes)
    kept = [mode for mode in modes if mode.log_evidence > best - RELEVANT][:3]
    return [mode.u for mode in kept], [INFLATION**2 * mode.covariance for mode in kept]


def refit(modes: list[Mode], x: Array, weight: Array, beyond: float = TRUSTING) -> StudentMixture:
    """What was drawn (n, d), weights (n,), what lies beyond it, and a little of the modes' curvature."""
    effective = 1.0 / float(np.sum(weight**2))
    count = int(np.clip(effective / (DRAWS_EACH * x.shape[1]), 1, MOST_COMPONENTS))
    means, covariances = _components(modes)
    fitted = fit_normals(x, weight, count)
    of_modes = np.full(len(means), MODES_SHARE / len(means))
    of_fit = (1.0 - MODES_SHARE) * fitted[2]
    return StudentMixture.build(
        [*means, *fitted[0], *fitted[0]],
        [*covariances, *fitted[1], *(BEYOND**2 * covariance for covariance in fitted[1])],
        np.concatenate([of_modes, (1.0 - beyond) * of_fit, beyond * of_fit]),
        (FREEDOM,) * len(means) + (FREEDOM if count == 1 else CLOSE_FREEDOM,) * count + (FREEDOM,) * count,
    )


def weigh(
    modes: list[Mode], evaluate: Evaluate, rng: np.random.RandomState, start: StudentMixture | None = None
) -> Weighed:
    """Refit a mixture by its own weighted draws until it fits; Laplace's, where no other is given.

    Each round's draws are weighed against the mixture of all rounds' proposals (Cornuet and others 2012,
    doi:10.1111/j.1467-9469.2011.00756.x), so that a refit to draws which few weights rule forgets none of the
    others. A mixture is judged by two more rounds of its own draws, and by whether it covers what any round
    met. Laplace's is given up where it is beyond help.
    """
    mixture = start or laplace_mixture(modes)
    rounds: list[tuple[StudentMixture, int]] = []
    drawn, log_p = np.empty((0, len(modes[0].u))), np.empty(0)
    shares: list[float] = []
    passed = 0
    while len(rounds) < ALL_ROUNDS:
        first = len(rounds) < FIRST_ROUNDS and max(shares, default=0.0) < GOOD_SHARE
        x = mixture.draw(FIRST_DRAWS if first and start is None else CHECKED, rng)
        own = evaluate(x)
        log_weight = own - mixture.log_density(x)
        shares.append(effective_share(log_weight))
        rounds.append((mixture, len(x)))
        drawn, log_p = np.concatenate([drawn, x]), np.concatenate([log_p, own])
        log_q = np.logaddexp.reduce([each.log_density(drawn) + np.log(n) for each, n in rounds])
        good = not first and min(shares[-1], covered(mixture, drawn, log_p, log_q)) >= GOOD_SHARE
        passed = passed + 1 if good and heaviness(log_weight) <= LIGHT else 0
        if passed == CONFIRMED:
            return Weighed(mixture, shares, True)
        if start is None and not first and max(shares[-2:]) < HOPELESS:
            break
        if not passed:
            beyond = LOOKING if first and start is not None else TRUSTING
            mixture = refit(modes, drawn, special.softmax(log_p - log_q), beyond)
    return Weighed(mixture, shares, False)


def covered(mixture: StudentMixture, drawn: Array, log_p: Array, log_q: Array) -> float:
    """Effective share that draws of the mixture would have, by all rounds' draws (n, d).

    ``log_q`` (n,) is the logarithm of the expected number of draws per volume.
    """
    log_weight = log_p - log_q
    log_integral = special.logsumexp(log_weight)
    ratio = log_p - log_integral - mixture.log_density(drawn)
    return float(np.exp(log_integral - special.logsumexp(log_weight + ratio)))


def heaviness(log_weight: Array) -> float:
    """Shape k̂ of the Pareto tail of weights (Vehtari and others 2024, JMLR 25(72)).

    A bent tail hides from the effective share of some hundred draws, as few of them are there. Zero where no
    draw weighs far more than the others.
    """
    tail = int(3.0 * np.sqrt(len(log_weight)))
    weight = np.exp(np.sort(log_weight) - log_weight.max())
    if weight.mean() > 1.0 / FAR_MORE:
        return 0.0
    return float(stats.genpareto.fit(weight[-tail:] - weight[-tail - 1], floc=0.0)[0])
