"""Readings at held length while the muscle is filled or vented: no motion before tells their friction."""

from __future__ import annotations

import numpy as np

from mpam_calib.specimen.motion import LEAVE_SDS, noise_sd, run_ids, run_starts, turn_threshold
from mpam_calib.specimen.recording import NO_BRANCH, Bools, Floats, Ints

GAUGE_SDS = 6.0
"""A pressure is off a stroke's own by so many sds of the gauge's noise ..."""
SETTLED, LAG = 0.01, 0.1
"""... and by this share of it, or by the larger one between two strokes of a level: a regulator settles."""
LEAST = 5
"""Fewer rows than this are noise."""
RANGE = (0.05, 0.95)
"""Quantiles of a stroke's readings between which its own pressure lies."""


def ways_and_holds(displacement: Floats, branch: Ints) -> list[tuple[slice, slice]]:
    """Each stroke's rows on the way, and those of the hold after it, where ``branch`` is read off the motion.

    One file's rows in time order; ``displacement`` in any unit.
    """
    near = max(0.4 * turn_threshold(displacement), LEAVE_SDS * noise_sd(displacement))
    starts = run_starts(run_ids(branch))
    ends = np.append(starts[1:], len(branch))
    found = []
    for start, end in zip(starts.tolist(), ends.tolist(), strict=True):
        x = displacement[start:end]
        left = np.flatnonzero(np.abs(x - np.median(x[:3])) > near)
        away = np.flatnonzero(np.abs(x - np.median(x[-3:])) > near)
        if branch[start] != NO_BRANCH and len(left) and len(away) and left[0] <= away[-1]:
            stopped = start + int(away[-1]) + 1
            found.append((slice(start + int(left[0]), stopped), slice(stopped, end)))
    return found


def held_rows(displacement: Floats, pressure: Floats, branch: Ints) -> Bools:
    """Rows (rows,) of holds, and before the first motion, that tell nothing of the level of their stroke.

    Their pressure is off it for a while; arguments as of :func:`filled_rows`.
    """
    held = np.zeros(len(branch), dtype=bool)
    error = GAUGE_SDS * noise_sd(pressure)
    strokes = ways_and_holds(displacement, branch)
    before = [(way, slice(0, way.start)) for way, _ in strokes[:1]]
    for way, hold in before + strokes:
        if (
            np.count_nonzero(_off(pressure[hold], [np.quantile(pressure[way], RANGE)], error, SETTLED))
            >= LEAST
        ):
            held[hold] = True
    return held


def filled_rows(displacement: Floats, pressure: Floats, branch: Ints, level: Ints) -> Bools:
    """Whether the muscle was being filled or vented, or had been since the crosshead stopped (rows,).

    One file's rows in time order, without a column ``branch``: that is read off the motion alone, and a hold
    has the branch of the stroke before it. ``displacement`` and ``pressure`` in any unit.
    """
    found = np.zeros(len(branch), dtype=bool)
    error = GAUGE_SDS * noise_sd(pressure)
    strokes = ways_and_holds(displacement, branch)
    if not strokes:
        return found
    own = [np.quantile(pressure[way], RANGE) for way, _ in strokes]
    levels = [int(np.median(level[way])) for way, _ in strokes]

    def off(rows: slice, i: int, beside: int, share: float) -> Bools:
        """Off the pressure of a stroke, and of the one beside it, if that is at the same level."""
        both = [own[i]]
        if 0 <= beside < len(own) and levels[beside] == levels[i]:
            both.append(own[beside])
        return _off(pressure[rows], both, error, share)

    first = slice(0, strokes[0][0].start)
    found[first] = off(first, 0, 1, SETTLED)
    for i, (_, hold) in enumerate(strokes):
        if i + 1 < len(strokes) and levels[i + 1] == levels[i]:
            found[hold] = off(hold, i, i + 1, LAG)
        else:
            found[hold] = off(hold, i, i - 1, SETTLED)
    return found


def _off(pressure: Floats, own: list[Floats], error: float, share: float) -> Bools:
    low, high = np.min(own), np.max(own)
    margin = max(error, share * abs(high))
    return np.asarray((pressure < low - margin) | (pressure > high + margin))
