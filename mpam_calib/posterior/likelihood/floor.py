"""What a floor hides: readings that only noise lifts above it.

Past the contraction at which a muscle goes slack a load cell reads its floor and noise, half of it above.
Such a reading is no force.
"""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.specimen.recording import Loops
from mpam_calib.specimen.summary import noise_within

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

SLACK_SDS = 5.0
"""Sds of noise that slack readings stay below, above a typical flagged one."""
SCATTER = 1.4826
"""Standard deviation of normal noise in its median size."""
HALF = 1.7
"""The same over that of those of its readings that lie on one side."""
OTHERS = 3
"""Readings below the typical flagged one, for each flagged one, from which on flags are not at a floor."""
PUSHES = 2.0
"""Noises of neighbours from which on the spread of flagged readings is none of a floor's."""


def beyond_floor(loops: Loops) -> NDArray[np.bool_]:
    """Rows at the slack end of their stroke: none further contracted reads clearly more than the floor.

    A bin that holds pulling and slack readings is neither; and of few slack readings all may lie above it, so
    that a stroke ends without a flag.
    """
    if not _at_the_bottom(loops.force_N, loops.censored):
        return np.zeros(len(loops.force_N), dtype=bool)
    first, lengths = loops.strokes
    stroke = np.repeat(np.arange(len(first)), lengths)
    noise = np.nan_to_num(noise_within(loops.force_N, stroke))
    pulls = loops.force_N > np.median(loops.force_N[loops.censored]) + SLACK_SDS * noise
    past = _past_the_pull(pulls, loops.displacement_m, stroke)
    return np.asarray(past & (np.abs(loops.branch) == 1))


def pulling(loops: Loops) -> NDArray[np.bool_]:
    """Rows of the loops whose branch is sure and whose force is one: not slack."""
    keep = np.ones(len(loops.force_N), dtype=bool) if loops.unclear is None else ~loops.unclear
    clear = loops.clear
    keep[keep] = ~(_between_flags(clear) | beyond_floor(clear))
    return keep


def _between_flags(loops: Loops) -> NDArray[np.bool_]:
    """Readings (rows,) from a stroke's first slack one to its last."""
    first, length = loops.strokes
    index = np.arange(len(loops.stroke))
    begin = np.minimum.reduceat(np.where(loops.censored, index, len(index)), first)
    end = np.maximum.reduceat(np.where(loops.censored, index, -1), first)
    return np.asarray((index >= np.repeat(begin, length)) & (index <= np.repeat(end, length)))


def lifted_by_noise(
    force: Array,
    place: Array,
    group: Ints,
    flagged: NDArray[np.bool_],
    floor: float | None,
    sd: float | None = None,
) -> NDArray[np.bool_]:
    """Static readings (n,) of each group that lie, along ``place``, past the last that clearly pulls.

    The noise is that of the flagged readings about the floor (N). Where these are spread far more than
    neighbours differ, the muscle pushes there: no floor holds them, and a reading above it is a force.
    Where they all read the floor itself, the noise is that of the others past them, at least the declared
    ``sd`` (N).
    """
    nothing = np.zeros(len(force), dtype=bool)
    if not _at_the_bottom(force, flagged):
        return nothing
    level = float(np.median(force[flagged])) if floor is None else floor
    noise = SCATTER * float(np.median(np.abs(force[flagged] - level)))
    if floor is None:
        noise *= HALF
    order = np.lexsort((place, group))
    if noise == 0.0:
        noise = _above_the_floor(force - level, place, group, flagged, sd)
    elif noise > PUSHES * noise_within(force[order], group[order]):
        return nothing
    return _past_the_pull(force > level + SLACK_SDS * noise, place, group)


def _above_the_floor(
    above: Array, place: Array, group: Ints, flagged: NDArray[np.bool_], sd: float | None
) -> float:
    """The noise (N) of readings past their group's first flag, of which one half is cut off.

    ``above`` (n,) is what they read above the floor. No noise where next to all of them are flagged: what is
    cut off there is behind the noise, and a reading above the floor is a force.
    """
    past = place > -_furthest(-place, group, flagged)
    lifted = past & ~flagged
    if not lifted.any() or int((past & flagged).sum()) > OTHERS * int(lifted.sum()):
        return 0.0
    order = np.lexsort((place, group))
    order = order[~(past | flagged)[order]]
    # Group by group, and not much more than before the flags: past a wrong one lie pulls.
    noise = max(SCATTER * float(pd.Series(above[lifted]).groupby(group[lifted]).median().median()), sd or 0.0)
    return float(np.fmin(noise, PUSHES * noise_within(above[order], group[order])))


def _at_the_bottom(force: Array, flagged: NDArray[np.bool_]) -> bool:
    """Whether there are flags (n,), and at the lowest readings: a wrong flag on a pull tells of no floor."""
    count = int(flagged.sum())
    return count > 0 and int((force < np.median(force[flagged])).sum()) <= OTHERS * count


def _past_the_pull(pulls: NDArray[np.bool_], place: Array, group: Ints) -> NDArray[np.bool_]:
    """Readings (n,) further along ``place`` than any of their group that pulls."""
    return np.asarray(place > _furthest(place, group, pulls))


def _furthest(place: Array, group: Ints, among: NDArray[np.bool_]) -> Array:
    """The largest place (n,) of some rows of each row's group; −∞ where there are none."""
    _, index = np.unique(group, return_inverse=True)
    last = np.full(int(index.max()) + 1, -np.inf)
    np.maximum.at(last, index, np.where(among, place, -np.inf))
    return np.asarray(last[index])
