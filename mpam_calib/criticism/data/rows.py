"""The raw readings behind the reduced rows, and which of them are looked at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings
from mpam_calib.posterior.likelihood.floor import pulling
from mpam_calib.posterior.likelihood.points import Points
from mpam_calib.posterior.likelihood.row_motion import rows_and_rest
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_STROKES, MOST_POINTS = 90, 600
"""Strokes, and static readings, that are looked at: what a search costs grows with their cube."""
MIDDLE = 0.9
"""Share of a stroke's way that is away from its turns."""


@dataclass(frozen=True)
class Rows:
    """Raw readings (n,) in strokes: what the model needs, force (N), stroke; not slack, not unclear.

    ``rest`` are those at which the crosshead stands still.
    """

    readings: Readings
    force: Array
    stroke: Ints
    rest: NDArray[np.bool_]

    @staticmethod
    def of(loops: Loops) -> Rows:
        """Those of the loops."""
        index = np.flatnonzero(pulling(loops))
        readings, rest = rows_and_rest(loops)
        return Rows(readings.take(index), loops.force_N[index], loops.stroke[index], rest[index])

    def middle(self, stroke: int) -> NDArray[np.intp]:
        """Indices of a stroke's readings away from its turns and rests.

        Next to a turn the crosshead hardly moves, at rest not at all: its friction is nobody's model.
        """
        inside = np.flatnonzero(self.stroke == stroke)
        x = self.readings.displacement[inside]
        away = np.abs(x - 0.5 * (x.min() + x.max())) < 0.5 * MIDDLE * np.ptp(x)
        return np.asarray(inside[away & ~self.rest[inside]])


def telling_strokes(loops: Loops) -> Ints:
    """The strokes that are looked at, as indices in the order of the loops.

    All of them, or of each level's cycles the first, the last and some between, closer together in the
    beginning: what happens to a muscle with the cycles happens in the first ones.
    """
    first, _ = loops.strokes
    if len(first) <= MOST_STROKES:
        return np.arange(len(first))
    level, cycle = loops.level[first], loops.cycle[first]
    chosen = np.zeros(len(first), dtype=bool)
    for here in (level == one for one in np.unique(level)):
        cycles = np.unique(cycle[here])
        count = max(2, len(cycles) * MOST_STROKES // len(first))
        places = np.round(np.geomspace(1, len(cycles), count)).astype(np.int64)
        chosen |= here & np.isin(cycle, cycles[places - 1])
    return np.flatnonzero(chosen)


def telling_points(points: Points) -> tuple[Ints, int]:
    """Static readings with a force: the indices of those that are looked at, and how many there are.

    All of them, or MOST_POINTS evenly along the pressure.
    """
    usable = np.flatnonzero(~points.censored & (points.kind < 2))
    if len(usable) <= MOST_POINTS:
        return usable, len(usable)
    ordered = usable[np.argsort(points.readings.pressure[usable], kind="stable")]
    places = np.round(np.linspace(0, len(usable) - 1, MOST_POINTS)).astype(np.int64)
    return np.sort(ordered[places]), len(usable)
