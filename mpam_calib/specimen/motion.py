"""Which way the crosshead moves: turning points, and the branch of every row."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from math import comb
from typing import NamedTuple

import numpy as np

from mpam_calib.specimen.recording import LOADING, NO_BRANCH, UNLOADING, Bools, Floats, Ints

RANGE_SHARE = 0.01
"""A turn counts only after moving back by this share of the range ..."""
NOISE_SDS = 10.0
"""... and by this many standard deviations of the encoder's noise (a long hold wanders over seven)."""
LEAVE_SDS = 7.0
"""A hold is over once the crosshead is this many standard deviations away from it."""

FEWEST, USUAL = 8, 0.99
"""Rows that tell a signal's noise, and the share of their differences that are no turns and jumps."""
SHARP = 0.5
"""Share of the noise that is left without turns where these were most of it: gentle ones are not."""
MIXED, NORMAL = 3.0, 0.6745
"""Times the usual row's noise that a mean square is believed up to, and normal noise's median in its sd."""

SIDE = 4
"""Rows at least on either side of a turn that tell where it is."""
WINDOW = 96
"""Rows around a turn, at most, that are looked at one by one; of more, means of as many."""
PLACES, ZOOMS = 17, 4
"""Places tried at once for a hold's beginning and for its end, and how often the search narrows."""
SHORTEST, SURE, IN_DOUBT = 1.0, 20.0, 5.0
"""Rows that a hold lasts at least, and twice the log likelihood by which it must fit better than none: to be
believed, and to be thought of."""
FINER = 2.0**0.5
"""Ratio of the numbers of rows, tried one after the other, in which a crosshead gathers its speed."""
LONG = 4
"""Times the rows of the motion beside it that a sure hold takes (a gentle turn takes about as many)."""
TINY = 1e-12
"""Share of a window's range that passes for an exact fit."""
NEXT = 2
"""Rows (or means) on either side of a turn that may lie on the other ..."""
UNSEEN_SDS, UNSEEN_RMS = 4.0, 4.0
"""... where they are not so many standard deviations (rather more than a quantum), nor so many times what the
fitted motion leaves, away from it (a hold of less than a row leaves little)."""


class Motion(NamedTuple):
    """Branch code of every row (rows,), and whether it could as well be the other one (rows,)."""

    branch: Ints
    unclear: Bools


def noise_sd(values: Floats, order: int = 2) -> float:
    """Standard deviation of the white noise on a slowly moving signal, shape (rows,) (same unit).

    From differences of this order, in which motion cancels that is steady (order 2) or gently changing
    (above); the largest hundredth (turns, jumps) is left out. Strokes of few rows turn more often: where
    their turns are sharp, only differences that span none are asked. Of slow strokes and a few that are too
    fast for their rows the usual row tells. 0 for fewer than eight rows.
    """
    if len(values) < FEWEST:
        return 0.0
    differences = np.diff(values, n=order)
    sd = _sd_of(differences, order)
    # A coarse encoder stands still for most rows: its noise is of its quantum.
    usual = max(float(np.median(np.abs(differences))) / NORMAL / _grows(order), _quantum(values))
    if sd > MIXED * usual:
        return usual
    turns = turning_points(values, max(RANGE_SHARE * float(np.ptp(values)), NOISE_SDS * sd))[1:-1]
    if len(turns) * (order - 1) <= (1.0 - USUAL) * len(differences):
        return sd
    spans = np.zeros(len(differences), dtype=bool)
    for back in range(1, order):
        spans[np.clip(turns - back, 0, len(spans) - 1)] = True
    steady = _sd_of(differences[~spans], order) if np.sum(~spans) >= FEWEST else sd
    return steady if steady < SHARP * sd else sd


def _sd_of(differences: Floats, order: int) -> float:
    square = differences**2
    kept = square[square <= np.quantile(square, USUAL)]
    return float(np.sqrt(kept.mean())) / _grows(order) if len(kept) else 0.0


def _grows(order: int) -> float:
    """Times the noise of one value that differences of this order have."""
    return float(np.sqrt(comb(2 * order, order)))


def _quantum(values: Floats) -> float:
    """The smallest step between two values that differ; 0 where all are one."""
    return float(np.diff(np.unique(values)).min(initial=np.inf)) if np.ptp(values) > 0.0 else 0.0


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


def read_motion(displacement: Floats, threshold: float, sd: float) -> Motion:
    """Branches from the direction of motion.

    ``displacement`` (rows in time order, one file, shortening positive); ``threshold`` as from
    :func:`turn_threshold`, ``sd`` the encoder's noise. Held rows take the branch of the motion
    before them, rows before the first motion NO_BRANCH: unclear, because friction then holds whatever came
    before. So is a row next to a turn, or to the end of a hold, where noise, the encoder's quantum or an
    unusual motion hide whether it moves already.
    """
    branch = np.full(len(displacement), NO_BRANCH, dtype=np.int64)
    unclear = np.zeros(len(displacement), dtype=bool)
    extremes = turning_points(displacement, threshold)
    if len(extremes) < 2:
        return Motion(branch, unclear)
    margin = max(0.4 * threshold, LEAVE_SDS * sd)
    unseen = UNSEEN_SDS * min(sd, noise_sd(displacement, 4))
    starts, codes = [], []
    before = int(extremes[0])
    for first, last in pairwise(extremes):
        rise = displacement[last] - displacement[first]
        codes.append(UNLOADING if rise > 0 else LOADING)
        turn = _turn(displacement[before : last + 1], int(first) - before, margin)
        origin = before
        if turn is None:
            turn, origin = _departure(displacement[first : last + 1], margin), int(first)
        starts.append(origin + turn.row)
        beside = np.arange(max(starts[-1] - turn.reach, 0), min(starts[-1] + turn.reach, len(branch)))
        unclear[beside] |= np.abs(displacement[beside] - turn.at) <= max(unseen, UNSEEN_RMS * turn.rms)
        before = int(first)
    if starts[0] <= max(3, 0.08 * (extremes[1] - extremes[0])):
        unclear[: starts[0] + NEXT] = False
        starts[0] = 0  # in motion from the first row, if gently
    unclear[: starts[0]] = True
    for start, end, code in zip(starts, [*starts[1:], len(branch)], codes, strict=True):
        branch[start:end] = code
    return Motion(branch, unclear)


class Turn(NamedTuple):
    """First row of a stroke, where the crosshead rested, how well that fits, and how many rows to doubt."""

    row: int
    at: float
    rms: float
    reach: int


def _turn(strokes: Floats, extreme: int, margin: float) -> Turn | None:
    """The turn between two strokes; None where the crosshead was held there for long.

    It lies where the two strokes meet, or at the end of the hold between them: so even the rows next to it,
    where the crosshead hardly moves, find their side.
    """
    travel = np.abs(strokes - strokes[extreme])
    ways = (np.flatnonzero(travel[:extreme] > depth * margin) for depth in (1.5, 6.0))
    back = (extreme + np.flatnonzero(travel[extreme:] > depth * margin) for depth in (1.5, 6.0))
    ends = [(int(i[-1]), int(o[0])) for i, o in zip(ways, back, strict=True) if len(i) and len(o)]
    if len(ends) < 2:
        return None
    (low, high), (far, farther) = ends
    if high - low > max(WINDOW, LONG * (low - far + farther - high)):
        return None
    first, last = max(min(far, extreme - SIDE), 0), min(max(farther, extreme + SIDE), len(strokes) - 1)
    merged = -(-(last + 1 - first) // WINDOW)
    if merged > 1:
        # Means of a long hold's rows must not swallow the few that the motion beside it takes.
        first, last = max(first - SIDE * merged, 0), min(last + SIDE * merged, len(strokes) - 1)
        count = (last + 1 - first) // merged
        values = strokes[first : first + count * merged].reshape(count, merged).mean(axis=1)
    else:
        values = strokes[first : last + 1]

    def within(row: int) -> float:
        return (row - first - 0.5 * (merged - 1)) / merged

    rest = _rest(values, within(low), within(high))
    if merged > 1 and rest.end > rest.begin:
        return None
    found = first + 0.5 * (merged - 1) + merged * rest.end
    return Turn(int(np.clip(np.floor(found) + 1, low + 1, high)), rest.at, rest.rms, NEXT * merged)


class Rest(NamedTuple):
    """Where (in rows) one stroke comes to rest and the next one leaves, at which value; residuals' rms.

    ``ramp``: rows in which it slows down before and gathers speed after (infinite: all that are looked at).
    """

    begin: float
    end: float
    at: float
    rms: float
    ramp: float = 0.0


def _rest(values: Floats, low: float, high: float) -> Rest:
    """Where, between the rows ``low`` and ``high``, one stroke comes to rest and where the next one leaves.

    Least squares of x = x_turn + k·way(begin − row) before and k'·way(row − end) after, at full speed into
    the turn and out of it, gently or in between (:func:`_way`). Both are one place, the turn, unless a hold
    between them fits surely better.
    """
    n = len(values)
    met = _search(values, low, high, _ramps(n), held=False)
    held = _search(values, low, high, {0.0, np.inf, met.ramp}, held=True)
    floor = TINY * float(np.ptp(values))
    better = n * np.log((met.rms**2 + floor**2) / (held.rms**2 + floor**2))
    if better > SURE and held.end - held.begin >= SHORTEST:
        return held
    # A short one cannot be told from another gentleness; but then a row lies where it would be.
    return met._replace(at=held.at) if better > IN_DOUBT else met


def _ramps(rows: int) -> list[float]:
    """Rows in which a crosshead may gather its speed where so many are looked at."""
    finite = FINER ** np.arange(1, 2.0 * np.log2(max(rows // 2, 1)) + 1.0)
    return [0.0, *finite.tolist(), np.inf]


def _way(rows: Floats, ramp: float) -> Floats:
    """Way after so many rows (0 or more) at a pace that grows over ``ramp`` rows and is steady after them."""
    if np.isinf(ramp):
        return rows**2
    early = np.minimum(rows, ramp)
    return np.asarray(rows - early + early**2 / (2.0 * ramp)) if ramp else rows


def _search(values: Floats, low: float, high: float, ramps: Iterable[float], *, held: bool) -> Rest:
    """The best fit of :func:`_rest` with or without a hold, each ramp tried."""
    rows = np.arange(len(values), dtype=np.float64)
    span = max(len(values) - 1, 1)
    one, two = np.divmod(np.arange(PLACES**2), PLACES) if held else (np.arange(2 * PLACES),) * 2
    share = np.linspace(-0.5, 0.5, PLACES if held else 2 * PLACES)
    middle = 0.5 * (low + high)
    best = Rest(middle, middle, float(values[int(np.clip(middle, 0, len(values) - 1))]), np.inf)
    for ramp in sorted(ramps):  # each on its own: on a coarse grid the wrong one may look better
        own, width = best._replace(begin=middle, end=middle, rms=np.inf), high - low
        for _ in range(ZOOMS):
            begin, end = np.clip(
                np.stack([own.begin + width * share[one], own.end + width * share[two]]), low, high
            )
            end = np.maximum(begin, end)
            before = _way(np.maximum(begin[:, None] - rows, 0.0) / span, ramp / span)
            after = _way(np.maximum(rows - end[:, None], 0.0) / span, ramp / span)
            X = np.stack([np.ones_like(before), before, after], axis=-1)
            turned = np.swapaxes(X, 1, 2)
            k = np.linalg.solve(turned @ X + 1e-9 * np.eye(3), turned @ values[:, None])[..., 0]
            rms = np.sqrt(np.mean((values - np.einsum("brk,bk->br", X, k)) ** 2, axis=1))
            i = int(rms.argmin())
            if rms[i] < own.rms:
                own = Rest(float(begin[i]), float(end[i]), float(k[i, 0]), float(rms[i]), ramp)
            width = 3.0 * width / PLACES
        if own.rms < best.rms:
            best = own
    return best


def _departure(stroke: Floats, margin: float) -> Turn:
    """Where a stroke leaves the hold at its beginning, because the noise hides the first steps.

    Found where the motion between one and two margins away, at full speed or gently begun, meets the hold.
    """
    travel = np.abs(stroke - stroke[0])
    far = min(2.0 * margin, 0.9 * float(travel[-1]))
    at_near, at_far = (int(np.flatnonzero(travel <= depth)[-1]) for depth in (0.5 * far, far))
    last = min(max(at_far + 1, at_near + SIDE), len(stroke) - 1)
    # Gently begun, the way to one margin takes 2.4 times as long as from there to two.
    first = max(at_near - 4 * (last - at_near), 0)
    beside = stroke[first : last + 1]
    rest = _search(beside, 0.0, float(at_near + 1 - first), _ramps(len(beside)), held=False)
    return Turn(int(np.clip(np.floor(first + rest.begin) + 1, 0, at_near + 1)), rest.at, rest.rms, NEXT)


def run_ids(*labels: Ints) -> Ints:
    """Number the contiguous runs of rows in which no label changes, from 0; shape (rows,)."""
    changes = np.zeros(len(labels[0]), dtype=np.int64)
    for label in labels:
        changes[1:] |= np.diff(label) != 0
    return np.cumsum(changes)


def run_starts(runs: Ints) -> Ints:
    """The first row of every run numbered by :func:`run_ids`."""
    return np.flatnonzero(np.diff(runs, prepend=-1)).astype(np.int64)
