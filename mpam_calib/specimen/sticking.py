"""A displacement that stands still while the force goes on: a gauge that sticks, or is read out rarely."""

from __future__ import annotations

import numpy as np

from mpam_calib.specimen.motion import run_ids, run_starts
from mpam_calib.specimen.recording import Bools, Floats, Ints, Loops
from mpam_calib.units import MM

AT_REST = 0.06
"""Up to this share of its stroke's largest step the crosshead is at rest."""
AT_ENDS = 0.005
"""Share of a stroke's way, at either end, where a crosshead may well stand."""

FEW_JUMPS, MOSTLY, STANDS, CREEPS, GOES_ON = 4, 0.8, 0.4, 0.2, 0.5
"""A reading of the displacement jumps and stands where it has so many jumps in a stroke, this share of them
by themselves, stands in this share of the steps, goes less than this share of the way in them, and the force
changes meanwhile by this share of what it changes in as many others."""
MARKS_APART = 0.7
"""Share of a jump that the marks of a ruler are apart at least."""
TELLING, FALLS = 0.1, 0.2
"""Strokes that are asked: of this share of the longest, along which the force falls by this share of its
largest. Where it is the same all along it does not tell whether it goes on."""

LONG, SHARE = 10, 0.02
"""A reading hangs that stands for so many rows and then catches up, by this share of its stroke ..."""
JUMP, USUAL = 5.0, 0.99
"""... and so many times what all but one in a hundred of its steps stay below."""


def under_way(loops: Loops) -> Bools:
    """Whether the crosshead is away from the ends of its stroke (rows,)."""
    first, rows = loops.strokes
    low, high = (np.repeat(f.reduceat(loops.displacement_m, first), rows) for f in (np.minimum, np.maximum))
    inside = np.minimum(loops.displacement_m - low, high - loops.displacement_m)
    return np.asarray(inside > AT_ENDS * (high - low))


def between_jumps(loops: Loops, inside: Bools) -> Ints:
    """Steps (strokes,) from one jump to the next of a reading that jumps and stands; 1 of any other stroke.

    A gauge that sticks, or one that is read out less often than the force, is no crosshead that stops and
    goes: the force goes on changing while it stands. ``inside`` (rows,) are those away from a stroke's ends.
    """
    first, rows = loops.strokes
    strokes, of = len(first), np.repeat(np.arange(len(first)), rows)[:-1]
    moving, still = _steps(loops, inside)
    moves = moving & ~still
    change = np.diff(loops.force_N)
    beside = np.append(still[1:], False) & np.append(False, still[:-1])

    def total(which: Bools, of_what: Floats | None = None) -> Floats:
        what = np.ones(len(of)) if of_what is None else of_what
        return np.asarray(np.bincount(of[which], what[which], strokes), dtype=np.float64)

    steps, jumps, standing = total(moving), total(moves), total(still)
    alone = (jumps >= FEW_JUMPS) & (total(moves & beside) >= MOSTLY * jumps)
    # Where a crosshead steps and waits, the force goes back while it waits.
    whole = total(moving, change)
    goes_on = np.sign(whole) * total(still, change) * steps > GOES_ON * standing * np.abs(whole)
    # Where steps are small all along, a few glitches are the largest.
    creeps, way = (np.abs(total(which, np.diff(loops.displacement_m))) for which in (still, moving))
    sticks = alone & (standing >= STANDS * steps) & (creeps < CREEPS * way) & goes_on
    apart = np.ceil(steps / np.maximum(jumps, 1)).astype(np.int64)
    return np.where(sticks, apart, 1)


def _steps(loops: Loops, inside: Bools) -> tuple[Bools, Bools]:
    """Whether each step from row to row (rows - 1,) is one of a stroke under way, and whether it stands."""
    first, rows = loops.strokes
    of = np.repeat(np.arange(len(first)), rows)
    moving = inside[:-1] & inside[1:] & (of[:-1] == of[1:])
    step, longest = np.abs(np.diff(loops.displacement_m)), np.zeros(len(first))
    np.maximum.at(longest, of[:-1][moving], step[moving])
    return moving, moving & (step <= AT_REST * longest[of[:-1]])


def sticking(loops: Loops) -> list[str]:
    """A remark on a displacement that stands still while the force goes on; at most one."""
    telling = _telling(loops)
    asked = np.repeat(telling, loops.strokes[1])
    return (_jumps_and_stands(loops, telling) or _hangs(loops, asked)) if asked.any() else []


def _telling(loops: Loops) -> Bools:
    """Whether a stroke (strokes,) is long enough, and its force falls enough, to tell."""
    first, rows = loops.strokes
    last = first + rows - 1
    way, falls = (np.abs(x[last] - x[first]) for x in (loops.displacement_m, loops.force_N))
    largest = np.maximum.reduceat(np.abs(loops.force_N), first)
    moves = (np.abs(loops.branch[first]) == 1) & (way > TELLING * np.ptp(loops.displacement_m))
    return np.asarray(moves & (falls > FALLS * largest))


def _jumps_and_stands(loops: Loops, telling: Bools) -> list[str]:
    """One that does so all along its strokes, and not from mark to mark of a coarse ruler."""
    inside = under_way(loops)
    sticks = telling & (between_jumps(loops, inside) > 1)
    moving, still = (which & np.repeat(sticks, loops.strokes[1])[:-1] for which in _steps(loops, inside))
    step = np.abs(np.diff(loops.displacement_m))
    jumps = moving & ~still
    if not jumps.any():
        return []
    # Its zero, and so its marks, may be other ones at each level.
    part = run_ids(loops.clock, loops.level)[:-1]
    parts = [part == one for one in np.unique(part[jumps])]
    places = [loops.displacement_m[:-1][at & still] for at in parts]
    ruled = [_at_marks(p, float(np.median(step[at & jumps]))) for p, at in zip(places, parts, strict=True)]
    if 2 * sum(ruled) >= len(ruled):
        return []
    readings, way = round(moving.sum() / jumps.sum()), float(np.median(step[jumps])) / MM
    return [
        f"loops: in {int(sticks.sum())} of {int(telling.sum())} strokes displacement_mm stands for about "
        f"{readings} readings and then jumps by {way:.2g} mm, "
        "while the force goes on; does the gauge stick, or is it read out less often than the load cell?"
    ]


def _at_marks(places: Floats, jump: float) -> bool:
    """Whether a reading stands at the marks of a ruler: always at the same places, a ``jump`` apart."""
    gaps = np.diff(np.sort(places))
    apart = gaps[gaps > AT_REST * jump]
    return bool(len(apart)) and bool(np.all(apart > MARKS_APART * jump))


def _hangs(loops: Loops, asked: Bools) -> list[str]:
    """One that stands for long in the midst of a stroke, and then catches up at once."""
    x, force = loops.displacement_m, loops.force_N
    steps = np.abs(np.diff(x))[np.diff(loops.stroke) == 0]
    if not steps.any():
        return []
    usual = float(np.quantile(steps[steps > 0.0], USUAL))
    first, rows = loops.strokes
    way, falls = (np.repeat(np.abs(v[first + rows - 1] - v[first]), rows) for v in (x, force))
    run = run_ids(loops.stroke, np.unique(x, return_inverse=True)[1].astype(np.int64))
    start = run_starts(run)
    last = np.append(start[1:], len(run)) - 1
    after = np.minimum(last + 1, len(run) - 1)
    jump = np.where(loops.stroke[after] == loops.stroke[start], np.abs(x[after] - x[start]), 0.0)
    change = np.abs(force[last] - force[start])
    long = asked[start] & (last - start + 1 >= LONG) & (jump > np.maximum(JUMP * usual, SHARE * way[start]))
    # A crosshead that rests and then moves on so fast takes the force along.
    found = np.flatnonzero(long & (change * way[start] > GOES_ON * jump * falls[start]))
    if not len(found):
        return []
    one = found[np.argmax(jump[found])]
    first, many = start[one], last[one] - start[one] + 1
    return [
        f"loops: displacement_mm stands at {x[first] / MM:.5g} for {many} readings from "
        f"{loops.time_s[first]:.6g} s after the first one on, while the force changes by {change[one]:.3g} "
        f"N, and then jumps by {jump[one] / MM:.3g} mm; did the gauge stick, or its logger hang?"
    ]
