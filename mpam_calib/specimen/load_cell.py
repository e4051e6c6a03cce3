"""What loops say about their load cell: the end of its range, a zero that is off, a standstill."""

from __future__ import annotations

import numpy as np

from mpam_calib.specimen.extremes import shared_extremes
from mpam_calib.specimen.motion import run_ids, run_starts
from mpam_calib.specimen.recording import Bools, Floats, Loops
from mpam_calib.units import KPA, MM

AT_TURNS = 0.02
"""Share of a stroke's way, at either end, where a crosshead that dwells repeats a force by itself."""
OFF = 0.05
"""Share of the largest force up to which a smallest force is no zero that is off."""
ALIKE = 0.2
"""Smallest forces within this share of them are alike: of early ends they go with the pressure ..."""
LEVELS, FURTHER = 3, 2.0
"""... where so many levels, the highest so many times the lowest, tell it."""
BEND, SAME_LENGTH = 0.25, 0.01
"""Shares of its neighbours' difference, and of its way, that a level contracts further than a line."""
STANDS, STANDS_WAY = 10, 0.02
"""A load cell stands still for at least so many readings, over this share of the crosshead's way ..."""
JUMP, USUAL = 5.0, 0.99
"""... and then jumps: by so many times what all but one in a hundred of its steps stay below."""


def odd_readings(loops: Loops, levels_Pa: Floats) -> list[str]:
    """Remarks on forces that hardly are the muscle's."""
    return [
        *_mostly_pushing(loops),
        *_at_a_limit(loops),
        *_zero_off(loops, levels_Pa),
        *_at_a_standstill(loops),
    ]


def _mostly_pushing(loops: Loops) -> list[str]:
    """Most forces below 0, though the muscle pulls where it is long."""
    median = float(np.median(loops.force_N))
    if median >= 0.0:
        return []
    return [
        f"loops: the median force is {median:.3g} N; was the load cell zeroed under load, or is the muscle "
        "driven beyond its free contraction?"
    ]


def _at_a_limit(loops: Loops) -> list[str]:
    """An extreme force that many readings share while the muscle moves."""
    asked = loops.force_N[_under_way(loops) & ~loops.censored]
    remarks = []
    for value in shared_extremes(asked, len(loops.force_N)):
        count = int(np.count_nonzero((loops.force_N == value) & ~loops.censored))
        largest = value == asked.max()
        question = (
            "did the load cell or its amplifier reach its limit?"
            if largest
            else f"is the muscle slack there? force_floor_N = {value:g} in [sensors] would say so"
        )
        remarks.append(
            f"loops: {count} of {len(loops.force_N)} readings are exactly {value:.6g} N, "
            f"the {'largest' if largest else 'smallest'}: {question}"
        )
    return remarks


def _zero_off(loops: Loops, levels_Pa: Floats) -> list[str]:
    """Smallest forces that say that a zero is off: alike and above 0 at all levels, or at one of them.

    At its free contraction a muscle pulls with nothing, whatever the pressure.
    """
    present = np.unique(loops.level[~loops.censored])
    pressure = levels_Pa[present]
    if len(present) < LEVELS or pressure[0] <= 0.0 or loops.censored.any():
        return []
    at = [loops.level == index for index in present]
    # The noise's own extremes are no smallest force.
    least = np.array([np.quantile(loops.force_N[rows], 0.01) for rows in at])
    shortest = np.array([loops.displacement_m[rows].max() for rows in at])
    off = OFF * float(loops.force_N.max())
    middle, span = float(np.median(least)), float(np.ptp(least))
    if least.min() > off and span < ALIKE * middle and pressure[-1] > FURTHER * pressure[0]:
        return [
            f"loops: the smallest force is about {middle:.3g} N at each of {len(present)} levels; was the "
            "load cell zeroed, or does every stroke end at that force?"
        ]
    return _one_zero_off(pressure, least, shortest, off)


def _one_zero_off(pressure: Floats, least: Floats, shortest: Floats, off: float) -> list[str]:
    """One level's smallest force off from those of all others, which are alike; it is none of the outermost.

    The contraction where the force is nothing grows with the pressure, ever less: a level that contracts as
    far as its neighbours make of it, or further, pulls with no more than they do, and conversely.
    """
    worst = int(np.argmax(np.abs(least - np.median(least))))
    rest = np.delete(least, worst)
    by = float(least[worst] - np.median(rest))
    if worst in (0, len(least) - 1) or abs(by) < off or np.ptp(rest) > ALIKE * abs(by):
        return []
    usual = float(np.interp(pressure[worst], np.delete(pressure, worst), np.delete(shortest, worst)))
    bend = BEND * abs(shortest[worst + 1] - shortest[worst - 1]) if by < 0.0 else 0.0
    if (usual - shortest[worst]) * np.sign(by) > bend + SAME_LENGTH * abs(usual):
        return []
    return [
        f"loops: the smallest force at {pressure[worst] / KPA:.4g} kPa is {least[worst]:.3g} N, that of the "
        f"other levels about {np.median(rest):.2g} N; was the load cell zeroed there?"
    ]


def _at_a_standstill(loops: Loops) -> list[str]:
    """Readings of one force while the muscle moves, and then a jump: a slack muscle and a coarse converter go
    on where they were, and so does a cell that is asked more rarely than the crosshead."""
    part = run_ids(loops.clock, loops.level)
    run = run_ids(part, np.unique(loops.force_N, return_inverse=True)[1].astype(np.int64))
    start = run_starts(run)
    end = np.append(start[1:], len(run))
    x = loops.displacement_m
    way = np.maximum.reduceat(x, start) - np.minimum.reduceat(x, start)
    after = np.minimum(end, len(run) - 1)
    jump = np.where(part[after] == part[start], np.abs(loops.force_N[after] - loops.force_N[start]), 0.0)
    steps = np.abs(np.diff(loops.force_N))[np.diff(part) == 0]
    usual = float(np.quantile(steps, USUAL)) if len(steps) else np.inf
    long = (end - start >= STANDS) & (way > STANDS_WAY * np.ptp(x)) & ~loops.censored[start]
    found = np.flatnonzero(long & (jump > JUMP * usual))
    if not len(found):
        return []
    one = found[np.argmax(way[found])]
    first, rows = start[one], end[one] - start[one]
    return [
        f"loops: the force stands at {loops.force_N[first]:.5g} N for {rows} readings from "
        f"{loops.time_s[first]:.6g} s after the first one on, while the muscle moves by "
        f"{way[one] / MM:.3g} mm, and then jumps by {jump[one]:.3g} N; did the load cell or its logger hang?"
    ]


def _under_way(loops: Loops) -> Bools:
    """Whether the crosshead is away from the ends of its stroke (rows,)."""
    first, rows = loops.strokes
    low = np.repeat(np.minimum.reduceat(loops.displacement_m, first), rows)
    high = np.repeat(np.maximum.reduceat(loops.displacement_m, first), rows)
    margin = AT_TURNS * (high - low)
    return np.asarray((loops.displacement_m > low + margin) & (loops.displacement_m < high - margin))
