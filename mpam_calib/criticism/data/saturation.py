"""Readings that a load cell could not show: a ceiling seen through noise."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.row_motion import rows_and_rest
from mpam_calib.specimen.recording import LOADING, NO_BRANCH, UNLOADING, Loops

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

CROWDED, BELOW = 2.0, 5
"""Readings about a ceiling, in those about a place next to it, of which so many are looked at."""
WITHIN = 3.0
"""Noise sds about a ceiling within which a reading may be one of it."""
FEWEST = 3
"""Readings of a stroke that tell whether it runs along the ceiling."""
BESIDE = 1.5
"""Readings beside the ceiling that are looked at, in those along it."""
CURVED = 4
"""Degree of a smooth curve without a ceiling; below one a stroke is a parabola."""
GAIN = 60.0
"""Squared noise sds that the ceiling must explain better than smooth curves do ..."""
SLACK = 0.25
"""Readings after it, in those along it, up to which a stroke's end is along the ceiling."""
FLAT = 1.5
"""... and times the noise's variance that it may leave."""


def along_a_ceiling(loops: Loops, noise: float) -> Bools:
    """Readings (rows,) along a largest force that strokes keep to.

    An amplifier that saturates in front of a converter adds its noise afterwards, so no two readings are the
    same. ``noise`` (N) is the sd of a reading. A muscle's own force has no edge: beside the ceiling every
    stroke is a parabola that breaks off, and no smooth curve through both does as well. Smallest forces are
    not looked at: there muscles go slack. Nor are readings at rest, whose force stands still by itself.
    """
    found, rest = np.zeros(len(loops.force_N), dtype=bool), rows_and_rest(loops)[1]
    moving = loops.without(rest)
    ceiling = _crowd(moving.force_N[~moving.censored], noise)
    if ceiling is None:
        return found
    found[~rest] = _strokes_along(moving, ceiling, noise)
    # Once it is shown, single readings at the ceiling are as wrong as those of strokes along it.
    return found | (loops.force_N > ceiling - WITHIN * noise) if found.any() else found


def _crowd(force: Array, noise: float) -> float | None:
    """The place (N) near the largest of the forces about which readings crowd; None where they do not."""
    if not len(force):
        return None
    ordered = np.sort(force)

    def about(places: Array) -> Array:
        """Readings within a noise's sd of places."""
        ends = np.searchsorted(ordered, [places - noise, places + noise])
        return np.asarray(ends[1] - ends[0])

    places = ordered[ordered > ordered[-1] - 2.0 * WITHIN * noise]
    ceiling = float(places[np.argmax(about(places))])
    next_to = np.array([ceiling - noise * (WITHIN + 2.0 * k) for k in range(1, BELOW + 1)])
    return ceiling if about(np.array([ceiling]))[0] > CROWDED * about(next_to).mean() else None


def _strokes_along(loops: Loops, ceiling: float, noise: float) -> Bools:
    """Readings of the strokes that run along a ceiling (N), where these show that it is one."""
    force = loops.force_N
    found = np.zeros(len(force), dtype=bool)
    usable = ~loops.censored & (True if loops.unclear is None else ~loops.unclear)
    near = usable & (force > ceiling - noise)
    gain, before_turns = 0.0, True
    for first, rows in zip(*loops.strokes, strict=True):
        at = first + np.flatnonzero(near[first : first + rows])
        if len(at) < FEWEST or loops.branch[first] == NO_BRANCH:
            continue
        ends = (int(first), int(at[0]), int(at[-1]) + 1, int(first + rows))
        seen = _missed_without(loops.displacement_m, force, ends, ceiling)
        if seen is not None:
            gain += seen / noise**2
            found[ends[1] : ends[2]] = usable[ends[1] : ends[2]]
            before_turns &= ends[3] - ends[2] <= SLACK * (ends[2] - ends[1])
    off = [force[found & (loops.branch == branch)] - ceiling for branch in (LOADING, UNLOADING)]
    flat = float(np.sum((force[found] - ceiling) ** 2)) < FLAT * noise**2 * np.sum(found)
    # Friction may keep one branch away; a backlash is at rest after a turn, never before it.
    clear = abs(off[0].mean() - off[1].mean()) < noise if all(map(len, off)) else before_turns
    return found if clear and flat and gain > GAIN else np.zeros_like(found)


def _missed_without(
    displacement: Array, force: Array, ends: tuple[int, int, int, int], ceiling: float
) -> float | None:
    """What a smooth curve misses (N²) beyond a parabola that breaks off at the ceiling; None if too short.

    ``ends``: where the stroke begins, runs along the ceiling, leaves it, and ends.
    """
    first, start, stop, last = ends
    beside = max(int(BESIDE * (stop - start)), 2 * FEWEST)
    sides = [slice(max(first, start - beside), start), slice(stop, min(last, stop + beside))]
    sides = [side for side in sides if side.stop - side.start >= 2 * FEWEST]
    if not sides:
        return None
    rows = np.concatenate([np.arange(start, stop), *(np.arange(s.start, s.stop) for s in sides)])
    x = displacement[rows]
    span = float(np.ptp(x))
    if span <= 0.0:
        return None
    x = 2.0 * (x - x.min()) / span - 1.0
    missed = _missed(x, force[rows], CURVED)[1]
    along = stop - start
    broken, begin = float(np.sum((force[start:stop] - ceiling) ** 2)), along
    for side in sides:
        here = slice(begin, begin + side.stop - side.start)
        curve, _ = _missed(x[here], force[side], 2)
        broken += float(np.sum((force[side] - np.minimum(curve, ceiling)) ** 2))
        begin = here.stop
    return missed - broken


def _missed(x: Array, force: Array, degree: int) -> tuple[Array, float]:
    """The polynomial along x through forces (N), and what it misses (N²)."""
    columns = legendre.legvander(x, degree)
    curve = columns @ np.linalg.lstsq(columns, force, rcond=None)[0]
    return curve, float(np.sum((force - curve) ** 2))
