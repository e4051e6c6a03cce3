"""Warm-up: fit the independence proposal to the posterior before the draws that count.

Laplace's covariance at the modes starts it; rounds of sampling from over-dispersed walkers then
refit it until it is accepted often, climbing again from any walker that found a better place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.collapsed import Collapsed
from mpam_calib.posterior.ensembles import Block, EnsembleState
from mpam_calib.posterior.mode import Mode, climb, curvature
from mpam_calib.posterior.proposal import StudentMixture

Array = NDArray[np.float64]

ROUNDS, STEPS = 6, 20
ENOUGH = 0.3
"""Accepted share at which the proposal is good enough."""
INFLATION = 1.15
BETTER = 3.0
"""Nats by which a walker must beat every known mode to be climbed from."""
RELEVANT = 8.0
"""Modes whose evidence is further below the best (nats) get no component of their own."""


@dataclass(frozen=True)
class WarmUp:
    """Result: states to go on from, the frozen proposal, the modes met, the accepted share by round."""

    states: list[EnsembleState]
    mixture: StudentMixture
    modes: list[Mode]
    accepted: list[float]


def laplace_mixture(modes: list[Mode]) -> StudentMixture:
    """The proposal before anything was drawn."""
    return StudentMixture.build([m.u for m in modes], [INFLATION**2 * m.covariance for m in modes])


def _refit(blocks: list[Block], modes: list[Mode]) -> StudentMixture:
    """The relevant modes' curvature, and the spread of the walkers in the round's second half (twice)."""
    drawn = np.concatenate([b.chain[len(b.chain) // 2 :].reshape(-1, b.chain.shape[2]) for b in blocks])
    covariance = INFLATION**2 * np.cov(drawn.T).reshape(drawn.shape[1], drawn.shape[1])
    covariance += 1e-10 * np.eye(len(covariance))
    best = max(mode.log_evidence for mode in modes)
    kept = [mode for mode in modes if mode.log_evidence > best - RELEVANT][:3]
    means = [mode.u for mode in kept] + [drawn.mean(axis=0)] * 2
    spreads = [INFLATION**2 * mode.covariance for mode in kept] + [covariance, covariance]
    return StudentMixture.build(means, spreads)


def _climb_again(target: Collapsed, blocks: list[Block], modes: list[Mode]) -> list[Mode]:
    """The modes, with the one that the best walker leads to where it beats them all."""
    best = max(blocks, key=lambda b: float(b.log_prob[-1].max()))
    walker = int(best.log_prob[-1].argmax())
    if best.log_prob[-1, walker] < max(m.log_posterior for m in modes) + BETTER:
        return modes
    u, top = climb(target, best.chain[-1, walker])
    return sorted([*modes, Mode(u, top, curvature(target, u, top))], key=lambda m: -m.log_posterior)


def warm_up(
    target: Collapsed,
    modes: list[Mode],
    states: list[EnsembleState],
    run: Callable[[list[EnsembleState], StudentMixture, int], list[Block]],
) -> WarmUp:
    """Rounds of sampling and refitting; ``run`` advances all ensembles by some steps."""
    mixture, accepted = laplace_mixture(modes), []
    for number in range(ROUNDS):
        blocks = run(states, mixture, STEPS)
        states = [block.state for block in blocks]
        accepted.append(float(np.mean([block.accepted for block in blocks])))
        # The first round still carries the wide starts; after it a good proposal is left alone.
        if number >= 1 and accepted[-1] >= ENOUGH:
            break
        modes = _climb_again(target, blocks, modes)
        mixture = _refit(blocks, modes)
    return WarmUp(states, mixture, modes, accepted)
