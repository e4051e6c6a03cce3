"""What every row of the loops knows of its motion: way since the turn, time at the level, speed, rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import FAR, TIMES, Readings
from mpam_calib.specimen.motion import run_ids, run_starts
from mpam_calib.specimen.recording import Loops
from mpam_calib.specimen.sticking import AT_REST, between_jumps, under_way

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

LOWEST_PRESSURE = 0.05
"""Share of the highest pressure below which relaxation is not told as a share of less."""
DEAD_STOP, ABRUPT = 0.2, 0.5
"""Under way with at least this share of it on one side and at rest on the other: a dead stop. So is any less
where it was under way with the second share before: the motion ended in the step to the row."""


def row_readings(loops: Loops) -> Readings:
    """Every row of the loops as a reading, unreduced."""
    return rows_and_rest(loops)[0]


def rows_and_rest(loops: Loops) -> tuple[Readings, NDArray[np.bool_]]:
    """The same, and whether the crosshead stands still at it (rows,)."""
    first, lengths = loops.strokes
    segment = np.repeat(np.arange(len(first)), lengths)
    travel, reversal, before = _history(loops, first, lengths)
    at_level, relaxed = _at_level(loops, first, lengths)
    speed, rest = _speeds(loops, first, first + lengths - 1, segment)
    readings = Readings(
        pressure=loops.pressure_Pa,
        displacement=loops.displacement_m,
        sign=np.where(np.abs(loops.branch) == 1, loops.branch, 0).astype(np.float64),
        level=loops.level,
        time=loops.time_s,
        file_time=loops.time_s - loops.began_s,
        time_at_level=at_level,
        cycle=loops.cycle.astype(np.float64),
        test_cycle=test_cycles(loops),
        travel=travel,
        reversal=reversal[segment],
        strokes_before=before[segment],
        behind=np.maximum.accumulate(loops.displacement_m) - loops.displacement_m,
        relaxed=relaxed,
        speed=speed,
        pace=_paces(speed, rest, segment)[segment],
    )
    return readings, rest


def test_cycles(loops: Loops) -> Array:
    """Cycles (rows,) counted over the whole test, from 1."""
    run = run_ids(loops.clock, loops.level)
    start = run_starts(run)
    first, last = (f.reduceat(loops.cycle, start) for f in (np.minimum, np.maximum))
    before = np.concatenate([[0], np.cumsum(last - first + 1)[:-1]])
    return np.asarray(loops.cycle + (before - first + 1)[run], dtype=np.float64)


def _history(loops: Loops, first: Ints, lengths: Ints) -> tuple[Array, Array, Array]:
    """Travel since the turn (rows); of strokes whether a reversal began them, and the lengths of the two
    before (strokes, 2)."""
    segment = np.repeat(np.arange(len(first)), lengths)
    same_level = _same_level(loops, first)
    opposite = np.zeros(len(first), dtype=bool)
    opposite[1:] = loops.branch[first][1:] == -loops.branch[first][:-1]
    last = first + lengths - 1
    direction = np.sign(loops.displacement_m[last] - loops.displacement_m[first])
    turned = same_level & opposite
    # The turn lies between two readings: what was travelled between them lies on either side of it.
    way_in = _half_step(loops.displacement_m, last, np.maximum(last - 2, first), -direction)
    way_out = _half_step(loops.displacement_m, first, np.minimum(first + 2, last), direction)
    speed_in = 2.0 * way_in / _step(loops.time_s, np.maximum(last - 2, first), last)
    speed_out = 2.0 * way_out / _step(loops.time_s, first, np.minimum(first + 2, last))
    speed_in = np.concatenate([[0.0], speed_in[:-1]])
    gap = np.concatenate([[0.0], loops.time_s[first][1:] - loops.time_s[last][:-1]])
    came_from = np.concatenate([[0.0], loops.displacement_m[last][:-1]])
    back = direction * (loops.displacement_m[first] - came_from)
    # At a speed of its own on either side the way after the turn is v'·t' with v·t + v'·t' travelled in all.
    share = speed_out / np.maximum(speed_in + speed_out, 1e-15)
    since_turn = np.where(turned, np.clip(share * (speed_in * gap + back), 0.0, 2.0 * way_out), way_out)
    turns = loops.displacement_m[first] - direction * since_turn
    since_turn = _since_the_start(loops, first, direction, turned, turns, since_turn, way_out)
    travel = since_turn[segment] + np.abs(loops.displacement_m - loops.displacement_m[first][segment])
    goes_on = np.concatenate([[False], loops.clock[first][1:] == loops.clock[first][:-1]]) & opposite
    ended = np.where(turned, turns, came_from)
    before = _lengths_before(np.abs(ended - np.concatenate([[0.0], turns[:-1]])), goes_on)
    return travel, turned.astype(np.float64), before


def _same_level(loops: Loops, first: Ints) -> NDArray[np.bool_]:
    """Whether each stroke (strokes,) is at the level of the one before it, on the same clock."""
    same = np.zeros(len(first), dtype=bool)
    same[1:] = (loops.level[first][1:] == loops.level[first][:-1]) & (
        loops.clock[first][1:] == loops.clock[first][:-1]
    )
    return same


def _at_level(loops: Loops, first: Ints, lengths: Ints) -> tuple[Array, Array]:
    """Time since the level was reached (rows,), s, and how far relaxation has come (rows, TIMES).

    On every clock the muscle begins without pressure; a step is made where its level's first row is.
    """
    new = ~_same_level(loops, first)
    begins = first[new]
    run = np.repeat(np.cumsum(new) - 1, lengths)
    at_level = loops.time_s - loops.time_s[begins][run]
    pressure = np.add.reduceat(loops.pressure_Pa, begins) / np.bincount(run)
    lowest = max(LOWEST_PRESSURE * float(np.abs(pressure).max()), 1.0)
    goes_on = np.diff(loops.clock[begins], prepend=-1) == 0
    fades = np.exp(-np.diff(loops.time_s[begins], prepend=0.0)[:, None] / TIMES)
    left = np.zeros((len(begins), len(TIMES)))
    for i, step in enumerate(np.diff(pressure, prepend=0.0)):  # levels, not rows
        left[i] = left[i - 1] * fades[i] + step if goes_on[i] else pressure[i]
    share = left / np.maximum(pressure, lowest)[:, None]
    reached = (pressure / np.maximum(pressure, lowest))[run, None]
    return at_level, reached - share[run] * np.exp(-at_level[:, None] / TIMES)


def _lengths_before(length: Array, goes_on: NDArray[np.bool_]) -> Array:
    """Lengths (strokes, 2) of the two strokes before each, from the ``length`` (strokes,) of the first, m.

    FAR where none of the other direction went before it in the same recording.
    """
    one = np.where(goes_on, length, FAR)
    two = np.where(goes_on, np.concatenate([[FAR], one[:-1]]), FAR)
    return np.stack([one, two], axis=1)


def _since_the_start(
    loops: Loops,
    first: Ints,
    direction: Array,
    turned: NDArray[np.bool_],
    turns: Array,
    known: Array,
    step: Array,
) -> Array:
    """The way ``known`` (strokes,) since each stroke's turn, put right for those that no turn began.

    A level's first stroke begins where the later ones of its direction turn, if that is within a step of its
    first reading: where in its step a recording begins is up to the rig.
    """
    result = known.copy()
    for i in np.flatnonzero(~turned):
        alike = turned & (direction == direction[i]) & (loops.level[first] == loops.level[first[i]])
        alike &= loops.clock[first] == loops.clock[first[i]]
        if alike.any():
            way = float(direction[i] * (loops.displacement_m[first[i]] - np.median(turns[alike])))
            if -0.5 * step[i] <= way <= 2.5 * step[i]:
                result[i] = max(way, 0.0)
    return result


def _half_step(displacement: Array, end: Ints, inner: Ints, direction: Array) -> Array:
    """Way (strokes,) travelled in the half step beyond the row ``end`` of each stroke, m.

    The speed there goes on changing as it did over the two steps to the row ``inner``: a crosshead that comes
    to rest gently travels less than one that turns at full speed.
    """
    middle = (end + inner) // 2
    near = direction * (displacement[middle] - displacement[end])
    far = direction * (displacement[inner] - displacement[middle])
    return np.asarray(0.5 * np.clip(near + 0.75 * (near - far), 0.0, np.maximum(far, near)))


def _step(time: Array, first: Ints, last: Ints) -> Array:
    """Mean time (strokes,) from one row to the next between two rows, s."""
    return np.asarray(np.maximum((time[last] - time[first]) / np.maximum(last - first, 1), 1e-9))


def _speeds(loops: Loops, first: Ints, last: Ints, segment: Ints) -> tuple[Array, NDArray[np.bool_]]:
    """Speed at every row (m/s), over a fortieth of the rows under way to either side; whether it is at rest.

    At rest the speed is the one that the stroke otherwise has: friction does not vanish with the motion.
    """
    rows = np.arange(len(segment))
    inside = under_way(loops)
    window = np.maximum(np.add.reduceat(inside.astype(np.int64), first) // 40, 1)
    window = np.maximum(window, between_jumps(loops, inside))[segment]
    local = _within(loops, window, first[segment], last[segment])
    fastest = np.maximum.reduceat(local, first)[segment]
    # In the corner of a dead stop the mean of both sides is a speed that the crosshead never had.
    before, after = np.maximum(rows - window, first[segment]), np.minimum(rows + window, last[segment])
    sides = np.stack([_between(loops, before, rows), _between(loops, rows, after)])
    inner = (before < rows) & (rows < after)
    beyond = np.stack(
        [
            _between(loops, np.maximum(before - window, first[segment]), before),
            _between(loops, after, np.minimum(after + window, last[segment])),
        ]
    )
    abrupt = np.take_along_axis(beyond, sides.argmax(axis=0)[None], axis=0)[0] >= ABRUPT * fastest
    stopped = sides.max(axis=0) >= np.where(abrupt, AT_REST, DEAD_STOP) * fastest
    corner = inner & (sides.min(axis=0) <= AT_REST * fastest) & stopped
    rest = (local <= AT_REST * fastest) | corner
    # Nor is it the mean of motion and rest next to one.
    changes = np.flatnonzero(np.diff(segment, prepend=-1) | np.diff(rest, prepend=rest[0]))
    ends = np.append(changes[1:], len(rows)) - 1
    run = np.cumsum(np.isin(rows, changes)) - 1
    start, stop = changes[run], ends[run]
    local = np.where(start < stop, _within(loops, window, start, stop), local)
    moving = np.maximum(np.add.reduceat((~rest).astype(np.float64), first), 1.0)
    typical = np.add.reduceat(np.where(rest, 0.0, local), first) / moving
    return np.where(rest, typical[segment], local), rest


def _paces(speed: Array, rest: NDArray[np.bool_], segment: Ints) -> Array:
    """A stroke's own speed (strokes,), m/s: the median over its rows under way, over all where none is."""
    still = np.bincount(segment, ~rest) == 0
    counted = ~rest | still[segment]
    speed, segment = speed[counted], segment[counted]
    order = np.lexsort((speed, segment))
    count = np.bincount(segment)
    first = np.cumsum(count) - count
    ordered = speed[order]
    return np.asarray(0.5 * (ordered[first + (count - 1) // 2] + ordered[first + count // 2]))


def _within(loops: Loops, window: Ints, start: Ints, stop: Ints) -> Array:
    """Speed (rows,) over ``window`` rows to either side, none beyond the rows ``start`` and ``stop``."""
    rows = np.arange(len(window))
    local = _between(loops, np.maximum(rows - window, start), np.minimum(rows + window, stop))
    # Next to a turn only one side is known: the speed there is not the mean of what follows.
    inward = np.where(rows - start < window, 1, np.where(stop - rows < window, -1, 0))
    reach = np.minimum(window, np.where(inward > 0, stop - rows, rows - start) // 2)
    one, two = rows + inward * reach, rows + 2 * inward * reach
    gentle = 1.5 * _between(loops, rows, one) - 0.5 * _between(loops, one, two)
    return np.where((inward != 0) & (reach > 0), np.clip(gentle, 0.2 * local, 2.0 * local), local)


def _between(loops: Loops, one: Ints, other: Ints) -> Array:
    """Mean speed (rows,) between two rows, m/s."""
    elapsed = np.maximum(np.abs(loops.time_s[other] - loops.time_s[one]), 1e-9)
    return np.asarray(np.abs(loops.displacement_m[other] - loops.displacement_m[one]) / elapsed)
