"""Pressure levels: which readings belong to one setting of the pressure."""

from __future__ import annotations

import numpy as np

from mpam_calib.specimen.close_levels import part_close
from mpam_calib.specimen.motion import run_ids, run_starts
from mpam_calib.specimen.recording import (
    DEPRESSURISING,
    LOADING,
    PRESSURISING,
    UNLOADING,
    Bools,
    Floats,
    Ints,
)
from mpam_calib.units import KPA

SAME_LEVEL_PA = 1.0 * KPA
"""Levels of two kinds of file are one if they differ by less than this ..."""
SAME_LEVEL_SHARE = 0.02
"""... or by less than this share of the level."""
STEADY = 10
"""Rows that a commanded setpoint stays on average, at least."""
TURNS = 0.1
"""Share of a stroke's way, at either end, where a commanded setpoint may change: holds, ramps begun early."""
ON_THE_WAY = 0.1
"""Share of all its changes that a commanded setpoint may make between them; one read back makes most."""
LEAST_RUN = 5
"""Fewer rows than this far from their stroke's level are noise, not a change of level."""
INNER, ALONG = (0.05, 0.95), (0.1, 0.9)
"""Quantiles between which a stroke's pressure counts: all but glitches, and all but its holds."""
SMALLEST_GAP_PA = 0.3 * KPA
SETPOINT_SHARE = 0.2
"""A level's readings may differ from its setpoint by this share of it."""
STATIC_GAPS = (0.01, 0.02)
"""Gaps between static levels, as shares of the largest reading: never below, surely above."""
STROKE_GAPS = (0.025, 0.04)
"""The same for strokes: a regulator lags, so the two branches of one level differ by a few percent ..."""
LAG = 0.1
"""... and by less than this share."""


def gap_clusters(values: Floats, shares: tuple[float, float], spread: float = 0.0) -> Ints:
    """Label readings of pressure (Pa, shape (n,)) by level, from 0 upwards.

    Sorted readings part where the gap is wide: surely above the larger of ``shares`` of the largest
    reading, never below the smaller one or three times ``spread`` (their own scatter); in between
    the largest jump in the sorted gaps decides, because gaps within a level are alike and small.
    """
    order = np.argsort(values, kind="stable")
    gaps = np.diff(values[order])
    top = float(np.abs(values).max())
    low = max(SMALLEST_GAP_PA, shares[0] * top, 3.0 * spread)
    high = max(low, shares[1] * top)
    between = np.sort(np.concatenate([[low], gaps[(gaps > low) & (gaps < high)], [high]]))
    jump = int(np.argmax(np.diff(np.log(between))))
    limit = float(np.sqrt(between[jump] * between[jump + 1]))
    labels = np.zeros(len(values), dtype=np.int64)
    labels[order] = np.concatenate([[0], np.cumsum(gaps > limit)])
    return labels


def static_levels(pressure: Floats) -> Ints:
    """Levels of readings without a clock (Pa, shape (n,)), from 0 upwards.

    A pressure swept without steps makes one endless cluster: such a one is cut into bins of 4 %
    of the largest reading, so that a level stays a level.
    """
    labels = gap_clusters(pressure, STATIC_GAPS)
    widest = 0.05 * float(np.abs(pressure).max())
    cut = np.zeros(len(pressure))
    for label in np.unique(labels):
        rows = labels == label
        if np.ptp(pressure[rows]) > widest:
            cut[rows] = np.floor((pressure[rows] - pressure[rows].min()) / (0.8 * widest))
    return np.unique(labels * (cut.max() + 1.0) + cut, return_inverse=True)[1].astype(np.int64)


def stroke_levels(
    pressure: Floats, units: Ints, branch: Ints, gaps: tuple[float, float] = STROKE_GAPS, least: int = 1
) -> Ints:
    """Levels of loops recorded in time, shape (rows,), from 0 upwards.

    ``pressure`` in Pa; ``units`` numbers the strokes (contiguous runs, from 0), ``branch`` their directions:
    the pressure of some is being changed on purpose (pressurising, depressurising). The others'
    medians, those of ``least`` rows or more, are clustered (``gaps`` as in :func:`gap_clusters`, and finer as
    in :func:`part_close`); then runs
    of rows that are clearly at another level (a change of pressure during a hold) are moved there. Where
    nothing but the pressure parts two strokes (each way back was left out), it does.
    """
    units = _cut_where_wide(pressure, units, gaps)
    starts = run_starts(units)
    pieces = np.split(pressure, starts[1:])
    medians = np.array([np.median(piece) for piece in pieces])
    scatter = np.array([np.median(np.abs(piece - m)) for piece, m in zip(pieces, medians, strict=True)])
    sizes = np.array([len(piece) for piece in pieces])
    steady = ~np.isin(branch[starts], [PRESSURISING, DEPRESSURISING])
    if not steady.any():
        return static_levels(pressure)
    counts = steady & (sizes >= max(least, 0.05 * np.median(sizes[steady])))
    if not counts.any():
        return static_levels(pressure)
    spread = 1.4826 * float(np.median(scatter[counts]))
    widths = np.array([np.ptp(np.quantile(piece, ALONG)) for piece in pieces])
    ways = branch[starts][counts]
    even = _without_lag(medians[counts], ways)
    label = part_close(even, widths[counts], ways, gap_clusters(even, gaps, spread), spread)
    centres = medians_by_label(even, label)
    own = np.empty(len(starts), dtype=np.int64)
    own[counts] = label
    own[~counts] = _nearest(medians[~counts], centres)
    off = np.zeros(len(starts))
    off[counts] = medians[counts] - centres[label]
    return _moved(pressure - off[units], own[units], centres)


def _without_lag(medians: Floats, branch: Ints) -> Floats:
    """Strokes' pressures (strokes,) in time order without the share by which their two directions differ.

    A regulator lags, so the pressure is always higher one way. Of a cycle's two turns one may be a change of
    level, so the lesser difference counts.
    """
    found = [LAG]
    for way in (LOADING, UNLOADING):
        here = np.flatnonzero((branch[:-1] == way) & (branch[1:] == -way))
        if len(here):
            before, after = medians[here], medians[here + 1]
            middle = np.maximum(0.5 * np.abs(before + after), SMALLEST_GAP_PA)
            found.append(float(np.median((before - after) / middle)) * way)
    lag = min(found, key=abs)
    return medians * (1.0 - 0.5 * lag * np.sign(branch)) if abs(lag) < LAG else medians


def _cut_where_wide(pressure: Floats, units: Ints, gaps: tuple[float, float]) -> Ints:
    """The strokes, those that go over several levels in pieces."""
    starts = run_starts(units)
    pieces = np.split(pressure, starts[1:])
    spread = np.array([np.ptp(np.quantile(piece, INNER)) for piece in pieces])
    wide = spread > gaps[1] * np.abs(pressure).max()
    if not wide.any():
        return units
    parts = gap_clusters(pressure, gaps)
    return run_ids(units, np.where(wide[units], parts, -1))


def _nearest(values: Floats, centres: Floats) -> Ints:
    return np.searchsorted((centres[1:] + centres[:-1]) / 2.0, values).astype(np.int64)


def _moved(pressure: Floats, own: Ints, centres: Floats) -> Ints:
    near = _nearest(pressure, centres)
    runs = run_ids(near)
    long = np.bincount(runs)[runs] >= LEAST_RUN
    return np.where(long, near, own)


def setpoint_levels(setpoint: Floats, displacement: Floats, branch: Ints, units: Ints) -> Ints:
    """Levels (rows,) by setpoints (Pa), from 0 upwards: each value, or what is close to it if read back.

    ``branch`` is that of the rough motion, ``units`` numbers its strokes. A setpoint that is commanded stays
    for many rows, and its values are far apart or change at turns and holds alone; one that is read back has
    noise, or flickers and drifts while the crosshead moves.
    """
    exact = np.unique(np.round(setpoint, 3), return_inverse=True)[1].astype(np.int64)
    changed = np.diff(exact, prepend=exact[0]) != 0
    if len(setpoint) >= STEADY * (np.count_nonzero(changed) + 1) and not _ramped(exact):
        far_apart = gap_clusters(setpoint, STATIC_GAPS).max() == exact.max()
        on_the_way = changed & _under_way(displacement, branch, units)
        if far_apart or np.count_nonzero(on_the_way) <= ON_THE_WAY * np.count_nonzero(changed):
            return exact
    return stroke_levels(setpoint, units, branch, STATIC_GAPS, STEADY)


def _ramped(values: Ints) -> bool:
    """Whether most of the values (rows,), numbered from 0, never stay."""
    starts = run_starts(run_ids(values))
    longest = np.zeros(values.max() + 1)
    np.maximum.at(longest, values[starts], np.diff(np.append(starts, len(values))))
    return bool(np.mean(longest < STEADY) > 0.5)


def _under_way(displacement: Floats, branch: Ints, units: Ints) -> Bools:
    """Whether the crosshead is between the turns of its stroke (rows,)."""
    starts = run_starts(units)
    low = np.minimum.reduceat(displacement, starts)[units]
    high = np.maximum.reduceat(displacement, starts)[units]
    share = TURNS * (high - low)
    between = (displacement > low + share) & (displacement < high - share)
    return np.asarray(between & np.isin(branch, [LOADING, UNLOADING]))


def same_level(pressure: Floats, level: Floats) -> Bools:
    """Whether pressures (Pa) are at levels (Pa), element by element."""
    tolerance = np.maximum(SAME_LEVEL_PA, SAME_LEVEL_SHARE * np.abs(level))
    return np.asarray(np.abs(pressure - level) <= tolerance)


def sorted_levels(pressure: Floats, level: Ints, filled: Bools) -> tuple[Ints, Floats]:
    """Levels numbered by rising median pressure, and these medians (Pa); those that read alike are one.

    Rows at which the muscle was being ``filled`` (rows,) count where a level has no others.
    """
    found = np.unique(level, return_inverse=True)[1].astype(np.int64)
    counts = ~filled | ~np.isin(found, found[~filled])

    def medians(label: Ints) -> Floats:
        return medians_by_label(pressure[counts], label[counts])

    place = np.unique(np.round(medians(found), 3), return_inverse=True)[1]
    level = place[found].astype(np.int64)
    return level, medians(level)


def merge_levels(loops_Pa: Floats, map_Pa: Floats) -> tuple[Floats, Ints, Ints]:
    """One sorted list of levels from those of loops and of a force map (Pa, each sorted).

    Returns the levels and, for loops and for the map, the index of each old level in it. A map's
    level near a loops level becomes that one and takes its pressure.
    """
    if not len(loops_Pa) or not len(map_Pa):
        levels = np.concatenate([loops_Pa, map_Pa])
        index = np.arange(len(levels), dtype=np.int64)
        return levels, index[: len(loops_Pa)], index[: len(map_Pa)]
    nearest = _nearest(map_Pa, loops_Pa)
    same = same_level(map_Pa, loops_Pa[nearest])
    levels = np.sort(np.concatenate([loops_Pa, map_Pa[~same]]))
    chosen = np.where(same, loops_Pa[nearest], map_Pa)
    return levels, np.searchsorted(levels, loops_Pa), np.searchsorted(levels, chosen)


def medians_by_label(values: Floats, labels: Ints) -> Floats:
    """Median of ``values`` for each label 0, 1, ... (labels without rows are left out by the caller)."""
    order = np.argsort(labels, kind="stable")
    pieces = np.split(values[order], run_starts(labels[order])[1:])
    return np.array([np.median(piece) for piece in pieces])


def setpoint_notes(setpoint: Floats, level: Ints, levels_Pa: Floats) -> list[str]:
    """A remark where setpoints (Pa, (rows,)) say other pressures than the readings of their levels."""
    wanted = medians_by_label(setpoint, level)
    apart = np.abs(wanted - levels_Pa) > SETPOINT_SHARE * np.maximum(np.abs(wanted), SAME_LEVEL_PA)
    if not apart.any():
        return []
    worst = int(np.argmax(np.where(apart, np.abs(wanted - levels_Pa), 0.0)))
    said, read = wanted[worst] / KPA, levels_Pa[worst] / KPA
    return [f"loops: setpoint_kPa is {said:.4g} where pressure_kPa reads {read:.4g}; it only groups the rows"]
