"""Cycles: counted where a file does not number them, and ended at the turns where it does."""

from __future__ import annotations

import numpy as np

from mpam_calib.specimen.motion import NEXT, run_ids, run_starts
from mpam_calib.specimen.recording import NO_BRANCH, Bools, Floats, Ints

DROPOUT = 5
"""Rows within which a leap of the encoder that is undone is a dropout, not a way back."""


def returns(displacement: Floats, level: Ints, branch: Ints) -> Ints:
    """How often (rows,) the crosshead has gone back without a reading: strokes of one direction alone.

    It is then at the other end and goes on from there; a dropout of the encoder is undone within a few rows.
    """
    step = np.diff(displacement, prepend=displacement[0])
    top, bottom = np.full((2, level.max() + 1), -np.inf)
    np.maximum.at(top, level, displacement)
    np.maximum.at(bottom, level, -displacement)
    far = np.abs(step) > 0.5 * (top + bottom)[level]
    same = np.diff(level, prepend=level[0]) == 0
    up, down = far & (step > 0.0), far & (step < 0.0)
    undone = (up & _near(down)) | (down & _near(up))
    return np.cumsum((step * branch > 0.0) & far & same & ~undone).astype(np.int64)


def _near(marked: Bools) -> Bools:
    """Whether a row is marked within the rows of a dropout on either side (rows,)."""
    before = np.concatenate([[0], np.cumsum(marked)])
    rows = np.arange(len(marked))
    last = np.minimum(rows + DROPOUT + 1, len(marked))
    return np.asarray(before[last] > before[np.maximum(rows - DROPOUT, 0)])


def number_cycles(level: Ints, clock: Ints, branch: Ints, returned: Ints) -> Ints:
    """Count cycles from 1 within each level; arrays of shape (rows,) in time order.

    A cycle is one stroke of each direction, in either order, and ends where the level does, or where the
    crosshead has ``returned`` unseen. Rows without a branch go with the stroke after them, at the end with
    the one before.
    """
    runs = run_ids(level, clock, branch, returned)
    starts = run_starts(runs)
    seen: set[int] = set()
    counts: dict[int, int] = {}
    place: tuple[int, int, int, int] | None = None
    numbers = np.zeros(len(starts), dtype=np.int64)
    for i, row in enumerate(starts):
        here = (int(level[row]), int(clock[row]), int(branch[row]), int(returned[row]))
        if here[2] == NO_BRANCH:
            continue
        same_stroke = place == here  # parted only by rows without a branch
        if not same_stroke and (place is None or place[0] != here[0] or here[2] in seen):
            counts[here[0]] = counts.get(here[0], 0) + 1
            seen = set()
        seen.add(here[2])
        place = here
        numbers[i] = counts[here[0]]
    return _fill_gaps(numbers, level[starts])[runs]


def cycles_at_turns(cycle: Ints, run: Ints, branch: Ints) -> Ints:
    """Cycle numbers (rows,) whose changes are moved to the turn beside them, as far as turns are uncertain.

    Else the row or two between the two would be a stroke of their own.
    """
    moved = cycle.copy()
    turns = np.flatnonzero(np.diff(branch)) + 1
    for change in np.flatnonzero((np.diff(cycle) != 0) & (np.diff(run) == 0)) + 1:
        beside = turns[np.abs(turns - change) <= NEXT]
        if len(beside):
            turn = int(beside[np.abs(beside - change).argmin()])
            moved[min(turn, change) : max(turn, change)] = cycle[change if turn < change else change - 1]
    return moved


def _fill_gaps(numbers: Ints, levels: Ints) -> Ints:
    following = 1
    filled = numbers.copy()
    for i in range(len(numbers) - 1, -1, -1):
        if filled[i] == 0:
            next_is_here = i + 1 < len(numbers) and levels[i + 1] == levels[i]
            before_is_here = i > 0 and levels[i - 1] == levels[i] and numbers[i - 1] > 0
            filled[i] = following if next_is_here else (numbers[i - 1] if before_is_here else 1)
        following = int(filled[i])
    return filled
