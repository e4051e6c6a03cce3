"""A journal of finished tasks: an interrupted search or ranking, begun again, reads what was done.

Both hand out their work in the same order each time, and what a task returns depends on nothing but the data
and the task. So the results need no other name than their number.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import count
from typing import TypeVar

from mpam_calib.criticism.problem import Problem
from mpam_calib.criticism.spread import Spread, spread_over
from mpam_calib.posterior.checkpoint import Checkpoint

T = TypeVar("T")
R = TypeVar("R")

EVERY = 2.0
"""Seconds of work that may be lost."""


@contextmanager
def journalled(problem: Problem, workers: int, journal: Journal | None) -> Iterator[Spread]:
    """Workers that hold the problem (:func:`mpam_calib.criticism.spread.spread_over`), under a journal."""
    with spread_over(problem, workers) as spread:
        yield spread if journal is None else journal.over(spread)


@dataclass
class Journal:
    """What the tasks of one command have returned so far, in the order in which they were handed out."""

    checkpoint: Checkpoint
    calls: int = 0

    def over(self, spread: Spread) -> Spread:
        """A spread that reads what the journal has, does the rest and writes it down."""

        def kept(function: Callable[[T], R], tasks: Iterable[T], chunk: int = 1) -> Iterator[R]:
            self.calls += 1
            return self._results(f"call_{self.calls:04d}", spread, function, list(tasks), chunk)

        return kept

    def _results(
        self, name: str, spread: Spread, function: Callable[[T], R], tasks: list[T], chunk: int
    ) -> Iterator[R]:
        done = 0
        numbers = count()
        while (part := self.checkpoint.load(f"{name}_{(number := next(numbers)):03d}")) is not None:
            done += len(part)
            yield from part
        pending: list[R] = []
        saved = time.monotonic()
        for result in spread(function, tasks[done:], chunk):
            pending.append(result)
            yield result
            if time.monotonic() - saved > EVERY:
                self.checkpoint.save(f"{name}_{number:03d}", pending)
                pending, number, saved = [], next(numbers), time.monotonic()
        if pending:
            self.checkpoint.save(f"{name}_{number:03d}", pending)
