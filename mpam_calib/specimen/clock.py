"""A recording's clock: strictly forward, or in ticks that hold several readings each."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.errors import InputError

if TYPE_CHECKING:
    from mpam_calib.specimen.source import DataFile

Floats = NDArray[np.float64]

COARSE = 0.05
"""Share of rows that repeat the time of the row before, from which the clock is coarse; fewer are a slip."""
COPIED = 0.5
"""Share of such rows that repeat everything else as well, from which rows were written twice."""
FIRST = 1 << 16
"""Rows of a file that tell its clock's usual tick, wherever blocks end."""
PAUSE = 2.0
"""Times what a tick's readings usually take, from which there is a pause behind them."""
EXPECTED = "a time later than the row before's (a list in [files] where each has its own clock)"


class Usual(NamedTuple):
    """How long (s) a tick that readings share usually is, and the step from one of them to the next."""

    tick: float
    step: float


@dataclass
class Clock:
    """The blocks of a file on a strictly forward clock.

    A clock that is written with fewer digits than the readings need repeats itself; the readings of such a
    tick are taken to be evenly spaced up to the next, or up to a pause.
    """

    file: DataFile
    rows: int = 0
    repeated: int = 0
    copied: int = 0
    first: tuple[int, float] | None = None
    """Row and time, s, of the first reading that repeats the time before."""

    def blocks(self) -> Iterator[pd.DataFrame]:
        """The file's blocks, readings that share a tick spread over it.

        Raises ``InputError`` at a step back in time, at the first repeated time where there are few, or
        where most repeat the whole row, and where the time never changes.
        """
        rest: pd.DataFrame | None = None
        usual: Usual | None = None
        tick = 0.0
        for block in self.file.blocks():
            whole = block if rest is None else pd.concat([rest, block])
            self._count(whole, 0 if rest is None else len(rest))
            if self.rows < FIRST:
                rest = whole
                continue
            time = whole["time_s"].to_numpy()
            usual = usual or usual_tick(time[:FIRST])
            # The last tick of a block may go on in the next.
            last, tick = _last_tick(time, tick)
            rest = whole.iloc[last:]
            if last:
                yield whole.iloc[:last].assign(time_s=spread_ticks(time[:last], float(time[last]), usual))
        assert rest is not None  # a file without rows is refused
        self._refuse_slips()
        time = rest["time_s"].to_numpy()
        _, tick = _last_tick(time, tick)
        if self.repeated and not tick:
            found = f"{time[0]:.10g} in every row (a clock that stands still)"
            raise InputError(self.file.label, found, EXPECTED, None, "time_s")
        end = float(time[-1]) + (tick or 1.0)
        yield rest.assign(time_s=spread_ticks(time, end, usual or usual_tick(time)))

    @property
    def coarse(self) -> bool:
        """Whether ticks were spread."""
        return self.repeated > 0

    def _count(self, block: pd.DataFrame, known: int) -> None:
        """Count the repeats of a block whose first ``known`` rows have been counted."""
        time = block["time_s"].to_numpy()
        step = np.diff(time)
        back = np.flatnonzero(step < 0.0)
        if len(back):
            row = int(back[0]) + 1
            found = f"{time[row]:.10g} after {time[row - 1]:.10g} (a step back in time)"
            raise InputError(self.file.label, found, EXPECTED, int(block.index[row]), "time_s")
        again = np.flatnonzero(step[max(known - 1, 0) :] == 0.0) + max(known - 1, 0) + 1
        self.rows += len(block) - known
        self.repeated += len(again)
        if len(again):
            values = block.to_numpy()
            self.copied += int((values[again] == values[again - 1]).all(axis=1).sum())
            if self.first is None:
                self.first = int(block.index[again[0]]), float(time[again[0]])

    def _refuse_slips(self) -> None:
        if self.first is None:
            return
        if self.repeated < COARSE * self.rows or self.copied > COPIED * self.repeated:
            row, time = self.first
            found = f"{time:.10g} after {time:.10g} (the time of the row before again)"
            raise InputError(self.file.label, found, EXPECTED, row, "time_s")


def _last_tick(time: Floats, before: float) -> tuple[int, float]:
    """Where the last of the times (n,), s, begins, and the step to it: as ``before`` where there is none."""
    last = int(np.searchsorted(time, time[-1]))
    return last, float(time[last] - time[last - 1]) if last else before


def usual_tick(time: Floats) -> Usual:
    """What is usual of a clock's times (n,), s; without bound where no readings share a tick."""
    starts = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    lengths, sizes = np.diff(time[starts]), np.diff(starts)
    shared = sizes > 1
    if not shared.any():
        return Usual(np.inf, np.inf)
    return Usual(float(np.median(lengths[shared])), float(np.median((lengths / sizes)[shared])))


def spread_ticks(time: Floats, end: float, usual: Usual) -> Floats:
    """Readings at equal times (n,), s, evenly spaced up to the next time, the last of them up to ``end``.

    Where there is a pause before the next, over what such a tick usually takes.
    """
    starts = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    if len(starts) == len(time):
        return time
    sizes = np.diff(np.append(starts, len(time)))
    lengths = np.diff(np.append(time[starts], end))
    # Where a buffer was late, a tick holds as many readings more as it is longer.
    longest = np.maximum(usual.tick, usual.step * sizes)
    lengths = np.where(lengths > PAUSE * longest, longest, lengths)
    within = np.arange(len(time)) - np.repeat(starts, sizes)
    return time + np.repeat(lengths / sizes, sizes) * within
