"""Adaptive importance sampling: refit a mixture to the posterior by its own weighted draws until it fits.

Laplace's covariance at the modes starts it. Where enough draws carry weight, and none far more than the
others, it is as good as the posterior itself. What a mixture misses of a bent tail, its own draws can fail
to show: it is taken only when many draws look for such a tail and find none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.posterior.chains.effective import effective_share
from mpam_calib.posterior.chains.proposal import CLOSE_FREEDOM, FREEDOM, StudentMixture, fit_normals
from mpam_calib.posterior.chains.rounds import Evaluate, Rounds
from mpam_calib.posterior.density.mode import Mode

Array = NDArray[np.float64]

INFLATION = 1.15
RELEVANT = 8.0
"""Modes whose evidence is further below the best (nats) get no component of their own."""
MODES_SHARE, BEYOND = 0.05, 2.5
"""Share of the proposal that stays with the modes, whatever was drawn; by how much wider the draws are
that look beyond what was met."""
LOOKING, TRUSTING = 0.5, 0.1
"""Share of draws that do so in the first rounds from what others met, and in all others."""
FEW_COMPONENTS, MOST_COMPONENTS, DRAWS_EACH, FITTED = 4, 20, 20, 6000
"""Components of a mixture that is fitted to a first round's draws, and to others'; effective draws per
dimension that each asks for; most draws that it is fitted to."""
FIRST_ROUNDS, ALL_ROUNDS, FIRST_DRAWS = 3, 9, 1000
"""Rounds of few draws that only refit, and all of them; draws of one of the first."""
GOOD_SHARE, HOPELESS = 0.6, 0.3
"""Effective share of weighted draws at which a mixture is good; in two rounds below the other none helps."""
CHECKED, CONFIRMED, FAR_MORE, LIGHT = 3000, 2, 3.0, 0.5
"""Draws of a round, and rounds, that look for a tail which the mixture misses; the multiple of the mean
weight from which on one is judged; the largest shape k̂ at which weights have a variance."""


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


def refit(
    modes: list[Mode], x: Array, weight: Array, beyond: float = TRUSTING, most: int = MOST_COMPONENTS
) -> StudentMixture:
    """What was drawn (n, d), weights (n,), what lies beyond it, and a little of the modes' curvature."""
    effective = 1.0 / float(np.sum(weight**2))
    count = int(np.clip(effective / (DRAWS_EACH * x.shape[1]), 1, most))
    means, covariances = _components(modes)
    if len(x) > FITTED:
        # As many by their weights: most of the others have next to none, and would take most of the time.
        places = (np.arange(FITTED) + 0.5) / FITTED
        x = x[np.minimum(np.searchsorted(np.cumsum(weight), places), len(x) - 1)]
        weight = np.full(FITTED, 1.0 / FITTED)
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

    A mixture is judged by two more rounds of its own draws, and by whether it covers what any round
    met. Laplace's is given up where it is beyond help.
    """
    mixture = start or laplace_mixture(modes)
    rounds = Rounds(len(modes[0].u))
    shares: list[float] = []
    good: list[Array] = []
    while rounds.count < ALL_ROUNDS:
        first = rounds.count < FIRST_ROUNDS and max(shares, default=0.0) < GOOD_SHARE
        count = FIRST_DRAWS if first and start is None else CHECKED
        log_weight = rounds.draw(mixture, count, evaluate, rng)
        shares.append(effective_share(log_weight))
        if not first and min(shares[-1], rounds.covered(mixture)) >= GOOD_SHARE:
            good.append(log_weight)
            if len(good) < CONFIRMED:
                continue
            if heaviness(np.concatenate(good)) <= LIGHT:
                return Weighed(mixture, shares, True)
        elif start is None and not first and max(shares[-2:]) < HOPELESS:
            break
        good = []
        beyond = LOOKING if first and start is not None else TRUSTING
        most = FEW_COMPONENTS if start is None and rounds.count <= FIRST_ROUNDS else MOST_COMPONENTS
        mixture = refit(modes, rounds.drawn, rounds.weight, beyond, most)
    return Weighed(mixture, shares, False)


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
