"""A journal of finished tasks: an interrupted search or ranking, begun again, reads what was done.

Both hand out their work in the same order each time, and what a task returns depends on nothing but the data
and the task. So results need no other name than the number of their call, what was called and the first
task: ``0012_best_of_000034`` holds what ``best_of``, the twelfth call, returned for its tasks from 34 on.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TypeVar

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.tasks.spread import Spread, spread_over
from mpam_calib.posterior.chains.checkpoint import Checkpoint

T = TypeVar("T")
R = TypeVar("R")

EVERY = 2.0
"""Seconds after which finished tasks are written down."""


@contextmanager
def journalled(problem: Problem, workers: int, journal: Journal | None) -> Iterator[Spread]:
    """Workers that hold the problem (:mod:`mpam_calib.criticism.tasks.spread`), under a journal."""
    with spread_over(problem, workers) as spread:
        yield spread if journal is None else journal.over(spread)


@dataclass
class Journal:
    """What the tasks of one command have returned so far, in the order in which they were handed out."""

    checkpoint: Checkpoint
    calls: int = 0

    def over(self, spread: Spread) -> Spread:
        """A spread that reads what the journal has, does the rest and writes it down."""

        def kept(function: Callable[[T], R], tasks: Iterable[T]) -> Iterator[R]:
            self.calls += 1
            name = getattr(function, "__name__", "results").strip("_")
            return self._results(f"{self.calls:04d}_{name}", spread, function, list(tasks))

        return kept

    def _results(self, name: str, spread: Spread, function: Callable[[T], R], tasks: list[T]) -> Iterator[R]:
        done = 0
        while (part := self.checkpoint.load(f"{name}_{done:06d}")) is not None:
            done += len(part)
            yield from part
        pending: list[R] = []
        saved = time.monotonic()
        for result in spread(function, tasks[done:]):
            pending.append(result)
            yield result
            if time.monotonic() - saved > EVERY:
                self._save(f"{name}_{done:06d}", pending)
                done, pending, saved = done + len(pending), [], time.monotonic()
        if pending:
            self._save(f"{name}_{done:06d}", pending)

    def _save(self, name: str, results: list[R]) -> None:
        # Where nothing can be kept the work goes on: it only cannot be resumed.
        with suppress(OSError):
            self.checkpoint.save(name, results)
