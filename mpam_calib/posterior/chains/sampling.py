"""Draw until it has converged: warm-up, then blocks of all ensembles, with a state kept after each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.chains.checkpoint import Checkpoint
from mpam_calib.posterior.chains.convergence import ESS_WANTED, Diagnostics, diagnose_chains
from mpam_calib.posterior.chains.ensembles import (
    Block,
    EnsembleState,
    Moves,
    advance,
    evaluate_held,
    start_states,
)
from mpam_calib.posterior.chains.warmup import WarmUp, warm_up
from mpam_calib.posterior.density.batch import batch_size
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.mode import Mode
from mpam_calib.posterior.density.pool import Workers, workers

Array = NDArray[np.float64]
T = TypeVar("T")

ENSEMBLES = 4
BLOCK = 40
LEAST = 160
"""Steps at least where no mixture fits: a tail that no walker has met shows in no figure."""
PATIENCE = 1.2, 1.5
"""Least and most by which the draws grow before they are looked at again: a look costs as much as they do."""
MAX_STEPS = 4000
"""Default budget of steps that count, for each ensemble."""


@dataclass(frozen=True)
class Progress:
    """What a listener is told after each block: steps done, the worst figures, the share of the way."""

    stage: str
    steps: int
    rhat: float
    ess: float
    share: float


Listener = Callable[[Progress], None]


@dataclass(frozen=True)
class Sampling:
    """Draws that count: chain (E, T, W, d) in sampler coordinates, log posterior (E, T, W)."""

    chain: Array
    log_prob: Array
    diagnostics: Diagnostics
    modes: list[Mode]
    acceptance: float
    warm_up_acceptance: list[float]
    cut: bool = False
    """Whether the budget ended it: with a larger one there would be other draws."""

    @property
    def converged(self) -> bool:
        """Whether every parameter met the limits."""
        return self.diagnostics.converged


def walkers_for(target: Collapsed) -> int:
    """Walkers of one ensemble: even, and several times the dimension; more where many cost hardly more."""
    return max(32, batch_size(target) // 2 * 2, 4 * len(target.model.names))


def sample(
    target: Collapsed,
    modes: list[Mode],
    seed: int,
    max_steps: int = MAX_STEPS,
    ess_wanted: float = ESS_WANTED,
    checkpoint: Checkpoint | None = None,
    listener: Listener | None = None,
) -> Sampling:
    """Sample the target with at least four independent, over-dispersed ensembles.

    Stops when R-hat across ensembles and both effective sample sizes meet their limits for every
    parameter, or after ``max_steps`` steps of each ensemble. With a checkpoint, stored blocks are
    taken over and the draws are those of an uninterrupted run.
    """
    tell = listener or (lambda progress: None)
    blocks: list[list[Block]] = []
    with workers(target, ENSEMBLES) as pool:
        warm = _warmed_up(target, modes, seed, pool, checkpoint, tell)
        states, steps, due = warm.states, 0, BLOCK
        while True:
            size = min(BLOCK, max_steps - steps)
            # Only whole blocks are stored: one that this budget cuts short is drawn whole by a larger one.
            store = checkpoint if size == BLOCK else None
            draw = partial(_advance, pool, states, warm.moves, size)
            block = _kept(store, f"block_{len(blocks):05d}", draw)
            states = [b.state for b in block]
            blocks.append(block)
            steps += size
            if steps < min(due, max_steps):
                continue
            chain = _joined([[b.chain for b in part] for part in blocks])
            figures = diagnose_chains(chain)
            ess = figures.ess_min
            in_time = steps >= due and size == BLOCK
            due = round(steps * min(max(PATIENCE[0], ess_wanted / ess), PATIENCE[1]))
            tell(Progress("sampling", steps, float(figures.rhat.max()), ess, min(ess / ess_wanted, 1.0)))
            enough = figures.meets(ess_wanted) and (warm.fits or steps >= LEAST)
            if enough or steps >= max_steps:
                break
    log_prob = _joined([[b.log_prob for b in part] for part in blocks])
    acceptance = float(np.mean([b.accepted for part in blocks for b in part]))
    return Sampling(chain, log_prob, figures, warm.modes, acceptance, warm.accepted, not (enough and in_time))


def _warmed_up(
    target: Collapsed,
    modes: list[Mode],
    seed: int,
    pool: Workers,
    checkpoint: Checkpoint | None,
    tell: Listener,
) -> WarmUp:
    """The ensembles after their warm-up, each with a seed of its own."""
    seeds = [int(s.generate_state(1)[0]) for s in np.random.SeedSequence(seed).spawn(ENSEMBLES)]

    def warm() -> WarmUp:
        tell(Progress("warming up", 0, float("nan"), 0.0, 0.0))
        walkers = walkers_for(target)
        return warm_up(
            target,
            modes,
            starts=lambda mixture: start_states(target, mixture, walkers, seeds),
            run=partial(_advance, pool),
            evaluate=lambda u: np.concatenate(pool.map(evaluate_held, np.array_split(u, ENSEMBLES))),
            seed=seeds[0],
        )

    return _kept(checkpoint, "warm_up", warm)


def _advance(pool: Workers, states: list[EnsembleState], moves: Moves, steps: int) -> list[Block]:
    """All ensembles so many steps further."""
    return pool.map(advance, [(state, moves, steps) for state in states])


def _kept(store: Checkpoint | None, name: str, make: Callable[[], T]) -> T:
    """The part that is stored under a name; else what ``make`` makes, stored where there is a store."""
    found: T | None = store.load(name) if store else None
    if found is None:
        found = make()
        if store:
            store.save(name, found)
    return found


def _joined(parts: list[list[Array]]) -> Array:
    """Arrays (T, ...) by block and ensemble as one (E, all T, ...)."""
    return np.concatenate([np.stack(part) for part in parts], axis=1)
