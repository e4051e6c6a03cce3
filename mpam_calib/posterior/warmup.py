"""Warm-up: fit the independence proposal to the posterior before the draws that count.

Laplace's covariance at the modes starts it; weighted draws from it refit it (adaptive importance
sampling), with a few components for a posterior that is askew. Where too few of them carry weight, rounds
of the ensembles themselves refit it, climbing again from any walker that found a better place. A last round
lets the over-dispersed starts settle, and its many draws fit the proposal that is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.collapsed import Collapsed
from mpam_calib.posterior.ensembles import Block, EnsembleState
from mpam_calib.posterior.mode import Mode, climb, curvature
from mpam_calib.posterior.proposal import CLOSE_FREEDOM, FREEDOM, StudentMixture, fit_normals

Array = NDArray[np.float64]

INFLATION = 1.15
RELEVANT = 8.0
"""Modes whose evidence is further below the best (nats) get no component of their own."""
WEIGHTED_ROUNDS, WEIGHTED_DRAWS = 4, 1000
GOOD_SHARE, POOR_SHARE = 0.7, 0.1
"""Effective share of weighted draws at which the proposal is good; or so poor that walkers must help."""
COMPONENTS = 3
MODES_SHARE = 0.1
"""Share of the proposal that stays with the modes, whatever was drawn."""
WALKER_ROUNDS, STEPS = 5, 25
ENOUGH = 0.3
"""Accepted share at which walkers have fitted the proposal well enough."""
BETTER = 3.0
"""Nats by which a walker must beat every known mode to be climbed from."""

Run = Callable[[list[EnsembleState], StudentMixture, int], list[Block]]
Evaluate = Callable[[Array], Array]


@dataclass(frozen=True)
class WarmUp:
    """States to go on from, the frozen proposal, the modes met, and how good it was round by round."""

    states: list[EnsembleState]
    mixture: StudentMixture
    modes: list[Mode]
    accepted: list[float]


def _components(modes: list[Mode]) -> tuple[list[Array], list[Array]]:
    best = max(mode.log_evidence for mode in modes)
    kept = [mode for mode in modes if mode.log_evidence > best - RELEVANT][:3]
    return [mode.u for mode in kept], [INFLATION**2 * mode.covariance for mode in kept]


def laplace_mixture(modes: list[Mode]) -> StudentMixture:
    """The proposal before anything was drawn."""
    return StudentMixture.build(*_components(modes))


def _with_fit(modes: list[Mode], x: Array, weight: Array) -> StudentMixture:
    """What was drawn (n, d), and a little of the modes' curvature."""
    effective = 1.0 / float(np.sum(weight**2))
    count = COMPONENTS if effective > 20 * COMPONENTS * x.shape[1] else 1
    means, covariances = _components(modes)
    fitted = fit_normals(x, weight, count)
    of_modes = np.full(len(means), MODES_SHARE / len(means))
    shares = np.concatenate([of_modes, (1.0 - MODES_SHARE) * fitted[2]])
    freedom = (FREEDOM,) * len(means) + (FREEDOM if count == 1 else CLOSE_FREEDOM,) * count
    return StudentMixture.build([*means, *fitted[0]], [*covariances, *fitted[1]], shares, freedom)


def _with_walkers(modes: list[Mode], blocks: list[Block]) -> StudentMixture:
    """What the walkers drew in the second half of their blocks, and a little of the modes' curvature."""
    drawn = np.concatenate([b.chain[len(b.chain) // 2 :].reshape(-1, b.chain.shape[2]) for b in blocks])
    return _with_fit(modes, drawn, np.full(len(drawn), 1.0 / len(drawn)))


def _weigh(modes: list[Mode], evaluate: Evaluate, seed: int) -> tuple[StudentMixture, list[float]]:
    """Refit by weighted draws; the effective share of each round."""
    mixture, shares = laplace_mixture(modes), []
    rng = np.random.RandomState(seed)
    for _ in range(WEIGHTED_ROUNDS):
        x = mixture.draw(WEIGHTED_DRAWS, rng)
        log_weight = evaluate(x) - mixture.log_density(x)
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        effective = 1.0 / float(np.sum(weight**2))
        shares.append(effective / WEIGHTED_DRAWS)
        if shares[-1] >= GOOD_SHARE or effective < 5 * x.shape[1]:
            break
        mixture = _with_fit(modes, x, weight)
    return mixture, shares


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
    starts: Callable[[StudentMixture], list[EnsembleState]],
    run: Run,
    evaluate: Evaluate,
    seed: int,
) -> WarmUp:
    """Fit the proposal, start the ensembles over-dispersed and let them settle.

    ``run`` advances all ensembles by some steps, ``evaluate`` gives the log posterior of many points.
    """
    mixture, accepted = _weigh(modes, evaluate, seed)
    states = starts(mixture)
    rounds = WALKER_ROUNDS if accepted[-1] < POOR_SHARE else 1
    for number in range(rounds):
        blocks = run(states, mixture, STEPS)
        states = [block.state for block in blocks]
        accepted.append(float(np.mean([block.accepted for block in blocks])))
        if number >= 2 and accepted[-1] >= ENOUGH:
            break
        # The first round still carries the wide starts.
        if 0 < number < rounds - 1:
            modes = _climb_again(target, blocks, modes)
            mixture = _with_walkers(modes, blocks)
    # Walkers that hardly moved are still their wide starts.
    if accepted[-1] >= ENOUGH:
        mixture = _with_walkers(modes, blocks)
    return WarmUp(states, mixture, modes, accepted)
