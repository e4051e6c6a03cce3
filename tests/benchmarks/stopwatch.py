"""Wall and processor seconds of a piece of work, its child processes included."""

from __future__ import annotations

import multiprocessing
import os
import time
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Drawn:
    """Draws (ensembles, steps, walkers, 11) in lab units, and the seconds that it took to draw them."""

    figures: NDArray[np.float64]
    wall: float
    cpu: float


def _cpu() -> float:
    """Processor seconds of this process, of the children it has waited for and of those that still run."""
    times = os.times()
    total = times.user + times.system + times.children_user + times.children_system
    for child in multiprocessing.active_children():
        try:
            with open(f"/proc/{child.pid}/stat", encoding="ascii") as stat:
                parts = stat.read().rpartition(")")[2].split()
        except OSError:
            continue
        total += (int(parts[11]) + int(parts[12])) / os.sysconf("SC_CLK_TCK")
    return total


@dataclass(frozen=True)
class Stopwatch:
    """Runs from the moment it is made."""

    start: tuple[float, float] = field(default_factory=lambda: (time.perf_counter(), _cpu()))

    def read(self) -> tuple[float, float]:
        """Wall and processor seconds since."""
        return time.perf_counter() - self.start[0], _cpu() - self.start[1]
