"""Independent emcee ensembles, advanced block by block; a block's end is a state to resume from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from emcee import EnsembleSampler, State
from emcee.moves import DEMove, DESnookerMove, StretchMove
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.posterior.chains.proposal import StudentMixture, independence_move
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.mode import evaluate
from mpam_calib.posterior.density.pool import held_target

Array = NDArray[np.float64]

ROUNDS = 100
"""Draws again for starts outside the posterior's support."""


@dataclass(frozen=True)
class EnsembleState:
    """Where one ensemble stands: walkers (W, d), their log posterior (W,), its random state."""

    coords: Array
    log_prob: Array
    random: Any


@dataclass(frozen=True)
class Block:
    """What one ensemble drew in a block: chain (steps, W, d), log posterior (steps, W), accepted share."""

    chain: Array
    log_prob: Array
    accepted: float
    state: EnsembleState


@dataclass(frozen=True)
class Moves:
    """A share ``independent`` of a walker's steps proposes from the mixture, the others find their way."""

    mixture: StudentMixture
    independent: float


def advance(task: tuple[EnsembleState, Moves, int]) -> Block:
    """Run one ensemble for a number of steps (in a worker)."""
    state, chosen, steps = task
    target = held_target()
    walkers, d = state.coords.shape
    moves = [
        (independence_move(chosen.mixture), chosen.independent),
        (DEMove(), 0.6 * (1.0 - chosen.independent)),
        (DESnookerMove(), 0.1 * (1.0 - chosen.independent)),
        (StretchMove(), 0.3 * (1.0 - chosen.independent)),
    ]
    sampler = EnsembleSampler(walkers, d, lambda u: evaluate(target, u), moves=moves, vectorize=True)
    start = State(state.coords, log_prob=state.log_prob, random_state=state.random)
    final = sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    return Block(
        sampler.get_chain(),
        sampler.get_log_prob(),
        float(np.mean(sampler.acceptance_fraction)),
        EnsembleState(final.coords, final.log_prob, final.random_state),
    )


def evaluate_held(u: Array) -> Array:
    """Log posterior (n,) of points (n, d) under the worker's target."""
    return evaluate(held_target(), u)


def start_states(
    target: Collapsed, mixture: StudentMixture, walkers: int, seeds: list[int]
) -> list[EnsembleState]:
    """Over-dispersed starts: three times as wide as the fitted mixture, inside the posterior's support.

    Raises ``InputError`` where ROUNDS of draws find none there.
    """
    states = []
    for seed in seeds:
        rng = np.random.RandomState(seed)
        coords = mixture.draw(walkers, rng, widen=3.0)
        log_prob = evaluate(target, coords)
        rounds = 0
        while np.any(bad := ~np.isfinite(log_prob)):
            if (rounds := rounds + 1) > ROUNDS:
                found = "no finite probability near the best fit"
                raise InputError("the data", found, "readings, none of them a code for a missing one")
            coords[bad] = mixture.draw(int(bad.sum()), rng, widen=1.0)
            log_prob[bad] = evaluate(target, coords[bad])
        states.append(EnsembleState(coords, log_prob, rng.get_state()))
    return states
