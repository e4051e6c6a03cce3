"""Warm-up: fit the independence proposal to the posterior before the draws that count.

Laplace's covariance at the modes starts it; weighted draws from it refit it (adaptive importance
sampling), with a few components for a posterior that is askew. Where enough of them carry weight, and none
far more than the others, one round of the ensembles lets their over-dispersed starts settle. Where few do,
the posterior is bent, and what a mixture misses of a bent tail its own draws cannot show: there the walkers
explore by moves that need no mixture, climbing again from any that found a better place. Many small
components then follow what the walkers met (or the draws of which some weigh far too much), and are refitted
by weighted draws that look beyond it. Where these carry weight, they are the greater part of the moves; else
a mixture of a few stays the smaller one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import special, stats

from mpam_calib.posterior.collapsed import Collapsed
from mpam_calib.posterior.ensembles import Block, EnsembleState, Moves
from mpam_calib.posterior.local import effective_share, follow
from mpam_calib.posterior.mode import Mode, climb, curvature
from mpam_calib.posterior.proposal import CLOSE_FREEDOM, FREEDOM, StudentMixture, fit_normals

Array = NDArray[np.float64]

INFLATION = 1.15
RELEVANT = 8.0
"""Modes whose evidence is further below the best (nats) get no component of their own."""
WEIGHTED_ROUNDS, WEIGHTED_DRAWS = 4, 1000
GOOD_SHARE = 0.7
"""Effective share of weighted draws at which the proposal is good."""
CHECKED, FAR_MORE, LIGHT = 3000, 3.0, 0.5
"""Draws that look for a tail which the proposal misses; the multiple of the mean weight from which on one is
judged; the largest shape k̂ of a tail at which the variance of weights is finite."""
INDEPENDENT, SHARED, EXPLORING = 0.9, 0.4, 0.1
"""Share of steps that propose from a good mixture, from another one, and while walkers explore."""
COMPONENTS, MORE_COMPONENTS = 3, 6
"""Of a mixture that is fitted to weighted draws, and to exploring walkers."""
MODES_SHARE = 0.1
"""Share of the proposal that stays with the modes, whatever was drawn."""
STEPS, ROUNDS, EXPLORED = 25, 4, 60
"""Steps in which starts settle; rounds of exploring, and the steps of each."""
LOCAL_ROUNDS, LOCAL_DRAWS = 6, 3000
"""Refits of a mixture that follows the walkers, and weighted draws of each."""
FOLLOWS, LOCAL_SHARE = 0.03, 0.6
"""Effective share from which on it is taken, and its share of the steps."""
ENOUGH = 0.3
"""Accepted share at which walkers that settled are fit to be fitted."""
BETTER = 3.0
"""Nats by which a walker must beat every known mode to be climbed from."""

Run = Callable[[list[EnsembleState], Moves, int], list[Block]]
Evaluate = Callable[[Array], Array]


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


def _components(modes: list[Mode]) -> tuple[list[Array], list[Array]]:
    best = max(mode.log_evidence for mode in modes)
    kept = [mode for mode in modes if mode.log_evidence > best - RELEVANT][:3]
    return [mode.u for mode in kept], [INFLATION**2 * mode.covariance for mode in kept]


def laplace_mixture(modes: list[Mode]) -> StudentMixture:
    """The proposal before anything was drawn."""
    return StudentMixture.build(*_components(modes))


def _with_fit(modes: list[Mode], x: Array, weight: Array, components: int = COMPONENTS) -> StudentMixture:
    """What was drawn (n, d), and a little of the modes' curvature."""
    effective = 1.0 / float(np.sum(weight**2))
    count = components if effective > 20 * components * x.shape[1] else 1
    means, covariances = _components(modes)
    fitted = fit_normals(x, weight, count)
    of_modes = np.full(len(means), MODES_SHARE / len(means))
    shares = np.concatenate([of_modes, (1.0 - MODES_SHARE) * fitted[2]])
    freedom = (FREEDOM,) * len(means) + (FREEDOM if count == 1 else CLOSE_FREEDOM,) * count
    return StudentMixture.build([*means, *fitted[0]], [*covariances, *fitted[1]], shares, freedom)


def _with_walkers(modes: list[Mode], blocks: list[Block], components: int = COMPONENTS) -> StudentMixture:
    """What the walkers drew in the second half of their blocks, and a little of the modes' curvature."""
    drawn = _drawn(blocks)
    return _with_fit(modes, drawn, np.full(len(drawn), 1.0 / len(drawn)), components)


def _drawn(blocks: list[Block]) -> Array:
    """What the walkers drew in the second half of their blocks (n, d)."""
    return np.concatenate([b.chain[len(b.chain) // 2 :].reshape(-1, b.chain.shape[2]) for b in blocks])


def _weigh(modes: list[Mode], evaluate: Evaluate, seed: int) -> tuple[StudentMixture, list[float]]:
    """Refit by weighted draws: the best mixture, and the effective share of each round."""
    mixture = best = laplace_mixture(modes)
    shares: list[float] = []
    rng = np.random.RandomState(seed)
    for _ in range(WEIGHTED_ROUNDS):
        x = mixture.draw(WEIGHTED_DRAWS, rng)
        log_weight = evaluate(x) - mixture.log_density(x)
        weight = np.exp(log_weight - log_weight.max())
        weight /= weight.sum()
        effective = 1.0 / float(np.sum(weight**2))
        shares.append(effective / WEIGHTED_DRAWS)
        # A refit to draws that few weights rule can be worse than what it was drawn from.
        if shares[-1] == max(shares):
            best = mixture
        if shares[-1] >= GOOD_SHARE or effective < 5 * x.shape[1]:
            break
        mixture = _with_fit(modes, x, weight)
    return best, shares


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
    enough = accepted[-1] >= GOOD_SHARE
    if enough:
        x = mixture.draw(CHECKED, np.random.RandomState([seed, 1]))
        log_weight = evaluate(x) - mixture.log_density(x)
        if heaviness(log_weight) <= LIGHT:
            return _settled(mixture, states, modes, accepted, run)
        weight = special.softmax(log_weight)
        enough = effective_share(log_weight) >= FOLLOWS
    if not enough:
        for number in range(ROUNDS):
            blocks = run(states, Moves(mixture, EXPLORING), EXPLORED)
            states = [block.state for block in blocks]
            accepted.append(_accepted(blocks))
            # The first round still carries the wide starts.
            if number > 0:
                modes = _climb_again(target, blocks, modes)
                mixture = _with_walkers(modes, blocks, MORE_COMPONENTS)
        x = _drawn(blocks)
        weight = np.full(len(x), 1.0 / len(x))
    local = follow(evaluate, x, weight, LOCAL_ROUNDS, LOCAL_DRAWS, np.random.RandomState(seed))
    accepted.append(local.share)
    moves = Moves(mixture, SHARED) if local.share < FOLLOWS else Moves(local.mixture, LOCAL_SHARE)
    blocks = run(states, moves, STEPS)
    accepted.append(_accepted(blocks))
    return WarmUp([block.state for block in blocks], moves, modes, accepted, False)


def _settled(
    mixture: StudentMixture, states: list[EnsembleState], modes: list[Mode], shares: list[float], run: Run
) -> WarmUp:
    """The states after a round by a proposal that fits, and the proposal that fits what they drew."""
    blocks = run(states, Moves(mixture, INDEPENDENT), STEPS)
    accepted = _accepted(blocks)
    # Walkers that hardly moved are still their wide starts.
    if accepted >= ENOUGH:
        mixture = _with_walkers(modes, blocks)
    moves = Moves(mixture, INDEPENDENT)
    return WarmUp([block.state for block in blocks], moves, modes, [*shares, accepted], True)


def _accepted(blocks: list[Block]) -> float:
    return float(np.mean([block.accepted for block in blocks]))
