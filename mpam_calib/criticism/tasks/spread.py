"""One problem, many tasks: the problem is handed to the workers once, not with every task."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, TypeVar

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.errors import Interrupted
from mpam_calib.posterior.density.pool import (
    executor_of,
    ignore_interrupts,
    results,
    settle_worker,
    start_method,
)

T = TypeVar("T")
R = TypeVar("R")

_PROBLEM: Problem | None = None


class Spread(Protocol):
    """``map`` whose functions find the problem with :func:`held_problem`; results in the tasks' order."""

    def __call__(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """Apply ``function`` to every task."""


@contextmanager
def spread_over(problem: Problem, workers: int) -> Iterator[Spread]:
    """Worker processes that hold the problem; with one worker everything stays in this process.

    Raises ``Interrupted`` where a worker is killed; where anything else is raised, nobody waits for them.
    """
    # What all need is there before they begin.
    assert len(problem.axes) == len(problem.bow) == len(problem.spreads[0]) == len(problem.root)
    assert problem.log_dets
    if workers == 1:
        before = _PROBLEM
        _hold(problem)
        try:
            yield lambda function, tasks: map(function, tasks)
        finally:
            _hold(before)
        return
    try:
        with executor_of(workers, start_method(), _begin, problem) as pool:
            yield lambda function, tasks: results(pool, function, tasks)
    except BrokenProcessPool as error:
        raise Interrupted("interrupted: a worker process was killed (for want of memory?)") from error


@dataclass(frozen=True)
class Alone:
    """A :class:`Spread` in this process, for a problem whose workers are gone."""

    problem: Problem

    def __call__(self, function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
        """One task after another."""
        with spread_over(self.problem, 1) as spread:
            yield from spread(function, tasks)


def held_problem() -> Problem:
    """The problem that this process works on."""
    assert _PROBLEM is not None
    return _PROBLEM


def _begin(problem: Problem) -> None:
    ignore_interrupts()
    settle_worker()
    _hold(problem)


def _hold(problem: Problem | None) -> None:
    global _PROBLEM
    _PROBLEM = problem
