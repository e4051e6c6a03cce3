"""The evidence of a cheap density in many dimensions, by many weighted draws.

Where a density costs microseconds, a mixture can be refitted round by round to some ten thousand of its own
draws, all of which count (:mod:`mpam_calib.posterior.chains.rounds`). The first is fitted to where an
annealed crowd ended, which need not be right. Of thin bent sheets each normal holds mostly air: few draws
carry weight, and what no round met goes unseen. The error is therefore at least half of what the rounds
changed of Laplace's figure, as that of :mod:`mpam_calib.posterior.evidence.annealed`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.posterior.chains.rounds import Rounds
from mpam_calib.posterior.chains.weighing import LOOKING, heaviness, refit
from mpam_calib.posterior.density.mode import Density, Mode, evaluate
from mpam_calib.posterior.evidence.annealed import lead

Array = NDArray[np.float64]

DRAWS, MOST_ROUNDS = 10_000, 16
"""Draws of a round, and rounds at most."""
ENOUGH = 0.03
"""Error (nats) at which the rounds end."""
HEAVIEST = 0.95
"""Largest shape of a Pareto tail that the error is reckoned with: from one on it has no mean."""


def weigh_adaptively(density: Density, mode: Mode, rng: np.random.RandomState) -> tuple[Rounds, float]:
    """All rounds' weighted draws about a mode, and the error (nats) of their log integral."""
    points = lead(density, [mode], rng)[1]
    mixture = refit([mode], points, np.full(len(points), 1.0 / len(points)), LOOKING)
    rounds, error = Rounds(len(mode.u)), float("inf")
    while rounds.count < MOST_ROUNDS and error > ENOUGH:
        rounds.draw(mixture, DRAWS, lambda u: evaluate(density, u), rng)
        mixture = refit([mode], rounds.drawn, rounds.weight)
        error = error_of(rounds.log_p - rounds.log_number)
    return rounds, max(error, 0.5 * abs(rounds.log_integral - mode.log_evidence))


def error_of(log_weight: Array) -> float:
    """Error (nats) of the logarithm of a mean of weights.

    Their own scatter, and what a Pareto tail of shape k holds beyond the heaviest of them, w: about
    w/(1 − k).
    """
    weight = special.softmax(log_weight)
    beyond = weight.max() / (1.0 - np.clip(heaviness(log_weight), 0.0, HEAVIEST))
    return float(np.sqrt(np.sum(weight**2) + beyond**2))
