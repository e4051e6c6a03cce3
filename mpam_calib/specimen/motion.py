"""Which way the crosshead moves: turning points, and the branch of every row."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from mpam_calib.specimen.recording import LOADING, NO_BRANCH, UNLOADING, Floats, Ints

RANGE_SHARE = 0.01
"""A turn counts only after moving back by this share of the range ..."""
NOISE_SDS = 10.0
"""... and by this many standard deviations of the encoder's noise (a long hold wanders over seven)."""
LEAVE_SDS = 7.0
"""A hold is over once the crosshead is this many standard deviations away from it."""

STRAIGHT, HELD = 1.7, 0.3
"""Ratio of two doublings of depth above which a turn has straight sides (2; a sine has √2), and the share of
its time that such a turn must be held to count as a hold."""

SIDE = 4
"""Rows at least on either side of a turn that tell where it is."""
ZOOM, ZOOMS = 16, 3
"""Half the number of places tried for a turn at once, and how often the search narrows."""


def noise_sd(values: Floats) -> float:
    """Standard deviation of the white noise on a slowly moving signal, shape (rows,) (same unit).

    From second differences, in which steady motion cancels; the largest hundredth (turns, jumps)
    is left out. 0 for fewer than eight rows.
    """
    if len(values) < 8:
        return 0.0
    second = np.diff(values, n=2) ** 2
    kept = second[second <= np.quantile(second, 0.99)]
    return float(np.sqrt(kept.mean() / 6.0)) if len(kept) else 0.0


def turning_points(values: Floats, threshold: float) -> Ints:
    """Indices of the alternating extremes of ``values`` that are ``threshold`` apart or more.

    Includes the first and the last extreme; one index only where nothing moves that far. Swings
    below the threshold are removed from the smallest up, all local minima of a pass at once, so
    that chatter of any kind is gone after a few passes (this is what a hysteresis comparator
    running along the rows would keep).
    """
    steps = np.diff(values)
    moving = np.flatnonzero(steps)
    if not len(moving):
        return np.zeros(1, dtype=np.int64)
    reversals = np.flatnonzero(np.diff(np.sign(steps[moving])))
    kept = np.concatenate([[0], moving[reversals] + 1, [len(values) - 1]]).astype(np.int64)
    # Quantised readings give equal swings: an irregular, tiny handicap decides between them.
    handicap = 1.0 + 1e-6 * ((kept * 0.6180339887) % 1.0)
    while len(kept) > 1:
        swing = np.abs(np.diff(values[kept]))
        if swing.min() >= threshold:
            return kept
        rank = swing * handicap[:-1]
        left = np.concatenate([[np.inf], rank[:-1]])
        right = np.concatenate([rank[1:], [np.inf]])
        smallest = np.flatnonzero((swing < threshold) & (rank <= left) & (rank < right))
        if len(swing) == 1:
            return kept[:1]
        keep = np.ones(len(kept), dtype=bool)
        inner = smallest[(smallest > 0) & (smallest < len(swing) - 1)]
        keep[inner] = keep[inner + 1] = False
        # At the ends only the outer point goes: the inner one may be a true extreme.
        keep[0] = smallest[0] != 0
        keep[-1] = smallest[-1] != len(swing) - 1
        kept, handicap = kept[keep], handicap[keep]
    return kept


def turn_threshold(displacement: Floats) -> float:
    """How far the crosshead must move back before a turn counts (same unit as ``displacement``)."""
    return max(RANGE_SHARE * float(np.ptp(displacement)), NOISE_SDS * noise_sd(displacement))


def detect_branch(displacement: Floats, threshold: float, sd: float) -> Ints:
    """Branch codes from the direction of motion, shape (rows,).

    ``displacement`` (rows in time order, one file, shortening positive); ``threshold`` as from
    :func:`turn_threshold`, ``sd`` the encoder's noise. Held rows take the branch of the motion
    before them, rows before the first motion NO_BRANCH.
    """
    branch = np.full(len(displacement), NO_BRANCH, dtype=np.int64)
    extremes = turning_points(displacement, threshold)
    if len(extremes) < 2:
        return branch
    margin = max(0.4 * threshold, LEAVE_SDS * sd)
    starts, codes = [], []
    before = int(extremes[0])
    for first, last in pairwise(extremes):
        rise = displacement[last] - displacement[first]
        codes.append(UNLOADING if rise > 0 else LOADING)
        turn = _turn(displacement[before : last + 1], int(first) - before, margin)
        after_hold = int(first) + _departure(displacement[first : last + 1], margin)
        starts.append(after_hold if turn is None else before + turn)
        before = int(first)
    if starts[0] <= max(3, 0.08 * (extremes[1] - extremes[0])):
        starts[0] = 0  # in motion from the first row, if gently
    for start, end, code in zip(starts, [*starts[1:], len(branch)], codes, strict=True):
        branch[start:end] = code
    return branch


def _turn(strokes: Floats, extreme: int, margin: float) -> int | None:
    """The first row after the turn between two strokes; None where the crosshead was held there.

    It lies where the two strokes meet: so even the rows next to it, where the crosshead hardly moves, find
    their side.
    """
    travel = np.abs(strokes - strokes[extreme])
    passages = []
    for depth in (1.5 * margin, 3.0 * margin, 6.0 * margin):  # a long hold wanders over one
        inbound = np.flatnonzero(travel[:extreme] > depth)
        outbound = np.flatnonzero(travel[extreme:] > depth)
        if not len(inbound) or not len(outbound):
            return None
        i, o = int(inbound[-1]), extreme + int(outbound[0])
        passages.append(
            (
                i + (travel[i] - depth) / max(travel[i] - travel[i + 1], 1e-12),
                o - (travel[o] - depth) / max(travel[o] - travel[o - 1], 1e-12),
            )
        )
    near, far, farther = (o - i for i, o in passages)
    straight = farther - far > STRAIGHT * (far - near)
    if straight and 2.0 * near - far > max(3.0, HELD * near):
        return None
    low, high = np.floor(passages[0][0]), np.ceil(passages[0][1])
    first = max(min(int(passages[-1][0]), extreme - SIDE), 0)
    last = min(max(int(passages[-1][1]) + 1, extreme + SIDE), len(strokes) - 1)
    middle = first + _meeting(strokes[first : last + 1], low - first, high - first)
    return int(np.clip(np.floor(middle) + 1, low + 1, high))


def _meeting(values: Floats, low: float, high: float) -> float:
    """Where (in rows, between ``low`` and ``high``) two strokes meet, each at a speed of its own.

    Least squares of x = x_turn + k·|row − c|ᵖ with a k for either side, and p = 1 (a crosshead that turns at
    full speed) or 2 (one that comes to rest): the fast stroke is nearer to the turn in time.
    """
    n = len(values)
    rows = np.linspace(0.0, 1.0, n)
    best, least = 0.5 * (low + high), np.inf
    centre, width = best, high - low
    for _ in range(ZOOMS):
        tried = np.clip(np.linspace(centre - 0.5 * width, centre + 0.5 * width, 2 * ZOOM + 1), low, high)
        away = rows - tried[:, None] / (n - 1)
        for power in (1, 2):
            before, after = np.maximum(-away, 0.0) ** power, np.maximum(away, 0.0) ** power
            X = np.stack([np.ones_like(away), before, after], axis=-1)
            turned = np.swapaxes(X, 1, 2)
            k = np.linalg.solve(turned @ X + 1e-9 * np.eye(3), turned @ values[:, None])
            left = np.sum((values - (X @ k)[..., 0]) ** 2, axis=1)
            if left.min() < least:
                best, least = float(tried[left.argmin()]), float(left.min())
        centre, width = best, width / ZOOM
    return best


def _departure(stroke: Floats, margin: float) -> int:
    """The row at which a stroke leaves the hold at its beginning.

    Found by extending the motion between one and two margins from the hold back to it, because the
    noise hides the first steps.
    """
    travel = np.abs(stroke - stroke[0])
    far = min(2.0 * margin, 0.9 * float(travel[-1]))
    near = 0.5 * far
    at_near = int(np.flatnonzero(travel <= near)[-1])
    at_far = int(np.flatnonzero(travel <= far)[-1])
    start = at_near - (at_far - at_near) * near / (far - near)
    return 1 + int(np.clip(round(start), 0, at_near))


def run_ids(*labels: Ints) -> Ints:
    """Number the contiguous runs of rows in which no label changes, from 0; shape (rows,)."""
    changes = np.zeros(len(labels[0]), dtype=np.int64)
    for label in labels:
        changes[1:] |= np.diff(label) != 0
    return np.cumsum(changes)


def run_starts(runs: Ints) -> Ints:
    """The first row of every run numbered by :func:`run_ids`."""
    return np.flatnonzero(np.diff(runs, prepend=-1)).astype(np.int64)


def number_cycles(level: Ints, clock: Ints, branch: Ints) -> Ints:
    """Count cycles from 1 within each level; arrays of shape (rows,) in time order.

    A cycle is one stroke of each direction, in either order, and ends where the level does. Rows
    without a branch go with the stroke after them, at the end with the one before.
    """
    runs = run_ids(level, clock, branch)
    starts = run_starts(runs)
    seen: set[int] = set()
    counts: dict[int, int] = {}
    place: tuple[int, int, int] | None = None
    numbers = np.zeros(len(starts), dtype=np.int64)
    for i, row in enumerate(starts):
        here = (int(level[row]), int(clock[row]), int(branch[row]))
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
