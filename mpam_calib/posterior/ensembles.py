"""Independent emcee ensembles, advanced block by block; a block's end is a state to resume from."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.pool import Pool
from typing import Any

import numpy as np
from emcee import EnsembleSampler, State
from emcee.moves import DEMove, DESnookerMove, StretchMove
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from mpam_calib.posterior.collapsed import Collapsed
from mpam_calib.posterior.mode import evaluate
from mpam_calib.posterior.proposal import IndependenceMove, StudentMixture

Array = NDArray[np.float64]


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


_TARGET: Collapsed | None = None


def advance(task: tuple[EnsembleState, StudentMixture, int]) -> Block:
    """Run one ensemble for a number of steps (in a worker)."""
    state, mixture, steps = task
    target = _TARGET
    assert target is not None
    walkers, d = state.coords.shape
    moves = [
        (IndependenceMove(mixture), 0.6),
        (DEMove(), 0.25),
        (DESnookerMove(), 0.05),
        (StretchMove(), 0.1),
    ]
    with threadpool_limits(1):
        sampler = EnsembleSampler(walkers, d, lambda u: evaluate(target, u), moves=moves, vectorize=True)
        start = State(state.coords, log_prob=state.log_prob, random_state=state.random)
        final = sampler.run_mcmc(start, steps, skip_initial_state_check=True)
    return Block(
        sampler.get_chain(),
        sampler.get_log_prob(),
        float(np.mean(sampler.acceptance_fraction)),
        EnsembleState(final.coords, final.log_prob, final.random_state),
    )


def start_states(
    target: Collapsed, mixture: StudentMixture, walkers: int, seeds: list[int]
) -> list[EnsembleState]:
    """Over-dispersed starts: three times as wide as the fitted mixture, inside the posterior's support."""
    states = []
    for seed in seeds:
        rng = np.random.RandomState(seed)
        coords = mixture.draw(walkers, rng, widen=3.0)
        log_prob = evaluate(target, coords)
        while np.any(bad := ~np.isfinite(log_prob)):
            coords[bad] = mixture.draw(int(bad.sum()), rng, widen=1.0)
            log_prob[bad] = evaluate(target, coords[bad])
        states.append(EnsembleState(coords, log_prob, rng.get_state()))
    return states


def _adopt(target: Collapsed) -> None:
    """Prepare a worker: it ignores Ctrl-C (its parent decides) and dies with its parent."""
    global _TARGET
    _TARGET = target
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)


@contextmanager
def workers(target: Collapsed, wanted: int) -> Iterator[Pool]:
    """A pool whose workers hold the target."""
    method = "fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn"
    count = max(1, min(wanted, os.cpu_count() or 1))
    with multiprocessing.get_context(method).Pool(count, initializer=_adopt, initargs=(target,)) as pool:
        yield pool
