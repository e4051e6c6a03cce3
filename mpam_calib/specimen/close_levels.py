"""Pressure levels that lie nearer to each other than a regulator's lag at the top level."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mpam_calib.specimen.recording import LOADING, UNLOADING, Floats, Ints
from mpam_calib.units import KPA

FINEST_PA, NOISE_SDS = 0.3 * KPA, 6.0
"""Levels differ by more than this, and by more than this many sds of a stroke's readings ..."""
TOP_SHARE = 0.005
"""... and by this share of the top level, within which regulators err alike at every pressure ..."""
WITHIN = 3.0
"""... and by so many times what the strokes of any one of them do, ..."""
ALONG = 2.0
"""... and so many times what the pressure changes along a stroke."""
FAR = 0.04
"""Share of a level by which no regulator wanders from cycle to cycle while both strokes of each agree."""
SPAN = 0.2
"""Nor do all its cycles together over this share of their middle."""
REPEATED, WITHIN_REPEATED = 2, 10.0
"""Levels that are nearer have been held for so many cycles one after the other, which differ so much less."""


def part_close(medians: Floats, widths: Floats, branch: Ints, label: Ints, spread: float) -> Ints:
    """Levels (strokes,) parted further, numbered from 0 by rising pressure, where they are surely several.

    ``medians`` (Pa, a regulator's lag taken off) and ``branch`` of the strokes in time order, ``widths`` (Pa)
    what the pressure changes along them, ``spread`` the sd of a reading about its stroke's median. What is
    left of the lag parts the two directions: so levels are several only where each has both (all that were
    recorded). A regulator's wandering parts cycles: so they are also far apart, or repeated, and have no
    fewer cycles than the other levels.
    """
    ways = set(np.unique(branch).tolist()) & {LOADING, UNLOADING}
    parts = {}
    for one in np.unique(label):
        here = np.flatnonzero(label == one)
        part = _parts(medians[here], spread)
        if part.any() and _apart(medians, widths[here], branch, here, part):
            parts[int(one)] = part
    whole = [_cycles(branch[label == one], ways) for one in np.unique(label) if int(one) not in parts]
    fine = np.zeros(len(label), dtype=np.int64)
    for one, part in parts.items():
        here = label == one
        fewest = min(_cycles(branch[here][part == i], ways) for i in range(part.max() + 1))
        if fewest >= min(whole, default=0):
            fine[here] = part
    return _by_pressure(medians, np.unique(label * (fine.max() + 1) + fine, return_inverse=True)[1])


def _parts(values: Floats, spread: float) -> Ints:
    """Parts (strokes,) of one level, from 0, cut at the gaps above the largest jump in the sorted gaps."""
    order = np.argsort(values, kind="stable")
    gaps = np.diff(values[order])
    least = max(FINEST_PA, NOISE_SDS * spread)
    wide = np.sort(gaps[gaps > least])
    parts = np.zeros(len(values), dtype=np.int64)
    if len(wide):
        jump = int(np.argmax(np.diff(np.log([least, *wide]))))
        parts[order] = np.concatenate([[0], np.cumsum(gaps >= wide[jump])])
    return parts


def _apart(medians: Floats, widths: Floats, branch: Ints, here: Ints, part: Ints) -> bool:
    """Whether the parts of the strokes ``here`` are levels, as far as these strokes tell."""
    values, ways = medians[here], set(np.unique(branch).tolist()) & {LOADING, UNLOADING}
    own = [part == i for i in range(part.max() + 1)]
    if not all(ways <= set(branch[here[rows]].tolist()) for rows in own):
        return False
    gap, within = _least_gap(values, part), max(float(np.ptp(values[rows])) for rows in own)
    top = float(np.abs(medians).max())
    if gap <= max(TOP_SHARE * top, WITHIN * within, ALONG * float(np.median(widths))):
        return False
    far = all(gap > FAR * abs(float(np.median(values[rows]))) for rows in own)
    wide = float(np.ptp(values)) > SPAN * abs(float(np.median(values)))
    repeated = all(
        _cycles(branch[here[rows]], ways) >= REPEATED and np.ptp(here[rows]) == np.count_nonzero(rows) - 1
        for rows in own
    )
    return far or wide or (repeated and gap > WITHIN_REPEATED * within)


def _cycles(branch: Ints, ways: set[int]) -> int:
    """How often strokes (strokes,) go each of these ways, at least."""
    return min((int(np.count_nonzero(branch == way)) for way in ways), default=0)


def _least_gap(values: Floats, part: Ints) -> float:
    own = [values[part == i] for i in range(part.max() + 1)]
    ends = sorted((float(v.min()), float(v.max())) for v in own)
    return min(after[0] - before[1] for before, after in pairwise(ends))


def _by_pressure(medians: Floats, label: Ints) -> Ints:
    centres = [float(np.median(medians[label == i])) for i in range(label.max() + 1)]
    return np.argsort(np.argsort(centres, kind="stable"))[label].astype(np.int64)
