"""Warm-up: fit the independence proposal to the posterior before the draws that count.

Weighted draws refit Laplace's mixture (``weighing.py``). Where it fits, a few steps of the ensembles let
their over-dispersed starts settle. Where it does not, the posterior is bent, and what a mixture misses of a
bent tail its own draws cannot show: there the walkers explore by moves that need no mixture, climbing again
from any that found a better place, and weighted draws that look beyond what they met refit it from there.
The less it fits, the smaller is its share of the moves.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.chains.ensembles import Block, EnsembleState, Moves
from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.chains.rounds import Evaluate
from mpam_calib.posterior.chains.weighing import refit, weigh
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.mode import Mode, climb, curvature

Array = NDArray[np.float64]

INDEPENDENT, FOLLOWING, SHARED, EXPLORING = 0.9, 0.6, 0.4, 0.1
"""Share of steps that propose from a mixture that fits, one that follows, another, and while exploring."""
FOLLOWS = 0.03
"""Effective share of weighted draws from which on a mixture is said to follow the posterior."""
STEPS, ROUNDS, EXPLORED = 25, 4, 60
"""Steps in which starts settle; rounds of exploring, and the steps of each."""
BETTER = 3.0
"""Nats by which a walker must beat every known mode to be climbed from."""

Run = Callable[[list[EnsembleState], Moves, int], list[Block]]


@dataclass(frozen=True)
class WarmUp:
    """States to go on from, the moves from here on, the modes met, and how good they were round by round.

    ``fits`` says whether the mixture is as good as the posterior itself, and few steps will do.
    """

    states: list[EnsembleState]
    moves: Moves
    modes: list[Mode]
    accepted: list[float]
    fits: bool


def warm_up(
    target: Collapsed,
    modes: list[Mode],
    starts: Callable[[StudentMixture], list[EnsembleState]],
    run: Run,
    evaluate: Evaluate,
    seed: int,
) -> WarmUp:
    """Fit the proposal, start the ensembles over-dispersed and let them settle.

    ``run`` advances all ensembles by some steps, ``evaluate`` gives the log posterior of many points.
    """
    rng = np.random.RandomState(seed)
    weighed = weigh(modes, evaluate, rng)
    quality, mixture = weighed.shares, weighed.mixture
    states = starts(mixture)
    if not weighed.fits:
        for number in range(ROUNDS):
            blocks = run(states, Moves(mixture, EXPLORING), EXPLORED)
            states = [block.state for block in blocks]
            quality.append(_accepted(blocks))
            # The first round still carries the wide starts.
            if number > 0:
                modes = _climb_again(target, blocks, modes)
                mixture = _met(modes, blocks)
        weighed = weigh(modes, evaluate, rng, mixture)
        quality += weighed.shares
    share = INDEPENDENT if weighed.fits else FOLLOWING if max(quality[-2:]) > FOLLOWS else SHARED
    moves = Moves(weighed.mixture, share)
    blocks = run(states, moves, STEPS)
    quality.append(_accepted(blocks))
    return WarmUp([block.state for block in blocks], moves, modes, quality, weighed.fits)


def _climb_again(target: Collapsed, blocks: list[Block], modes: list[Mode]) -> list[Mode]:
    """The modes, with the one that the best walker leads to where it beats them all."""
    best = max(blocks, key=lambda b: float(b.log_prob[-1].max()))
    walker = int(best.log_prob[-1].argmax())
    if best.log_prob[-1, walker] < max(m.log_posterior for m in modes) + BETTER:
        return modes
    u, top = climb(target, best.chain[-1, walker])
    return sorted([*modes, Mode(u, top, curvature(target, u, top))], key=lambda m: -m.log_posterior)


def _met(modes: list[Mode], blocks: list[Block]) -> StudentMixture:
    """A mixture of what the walkers met in the second half of their blocks."""
    x = np.concatenate([b.chain[len(b.chain) // 2 :].reshape(-1, b.chain.shape[2]) for b in blocks])
    return refit(modes, x, np.full(len(x), 1.0 / len(x)))


def _accepted(blocks: list[Block]) -> float:
    return float(np.mean([block.accepted for block in blocks]))
