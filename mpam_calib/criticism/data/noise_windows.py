"""Pieces of strokes in which only the noise is left: the muscle's own curve is taken out of them.

Of consecutive rows inside a stroke a polynomial is taken out; of two strokes that repeat each other the
difference is what the muscle did not do twice. The first are many and short, and see little of a noise that
is correlated for longer than a few of their rows; the second see that.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.posterior.likelihood.scatter import FastScatter
from mpam_calib.posterior.likelihood.sites import usual_chunks
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

WINDOW, LONG_WINDOW, DEGREE = 32, 48, 3
"""Windows of at most so many rows, of one stroke or of two, detrended by a polynomial of this degree ..."""
SHORT_DEGREE = 5
"""... or of this one, where a stroke is so short that it is one window."""
USUAL = 4.0
"""Multiple of the typical power above which a window holds more than noise."""
FEWEST_TELL = 40
"""Contrasts of short strokes that are enough to tell their noise from."""
CURVE_DEGREE, CURVE_ROWS = 12, 8
"""Degree of the curve that strokes share, and readings for each degree."""
FEWEST_PAIRS = 6
"""Pairs of repeated strokes that are enough to tell the noise from."""
CHANCE = 0.1
"""Probability by which pairs with a level's first stroke would differ by so much more by chance."""
ALIKE = 20
"""Strokes repeat each other where their numbers of rows differ by a row, or by one in so many ..."""
PACE = 0.1
"""... and the logarithms of their time steps by no more than this: others are driven at another speed."""


class Windows(NamedTuple):
    """What the contrasts of windows see (k, dof), the windows' mean forces (k,) and time steps (k, 2), s.

    A window of two strokes has the steps of both, another one its own twice.
    """

    chunks: Array
    force: Array
    contrast: Array
    dt: Array

    def usual(self, grows: bool) -> Windows:
        """Without bursts and snaps, which must not pass for noise.

        They are far above the typical window, or above those of similar force where noise grows with it.
        """
        if grows:
            return self.take(usual_chunks(self.chunks, self.force))
        power = np.mean(self.chunks**2, axis=1)
        return self.take(power <= USUAL * np.median(power))

    def paces(self) -> list[Windows]:
        """The windows parted by their time steps, which strokes at two speeds may have one each of."""
        log = np.log(self.dt).ravel()
        order = np.argsort(log, kind="stable")
        pace = np.empty(len(log), dtype=np.int64)
        pace[order] = np.cumsum(np.diff(log[order], prepend=log[order[0]]) > PACE)
        kinds, own = np.unique(np.sort(pace.reshape(-1, 2), axis=1), axis=0, return_inverse=True)
        return [self.take(np.flatnonzero(own.ravel() == kind)) for kind in range(len(kinds))]

    def take(self, which: NDArray[np.bool_] | Ints) -> Windows:
        """Those picked by a mask or by numbers."""
        return self._replace(chunks=self.chunks[which], force=self.force[which], dt=self.dt[which])

    def scatter(self, dt: float) -> FastScatter:
        """As the likelihood of fast noise takes it, the readings ``dt`` (s) apart."""
        return FastScatter(self.chunks.T @ self.chunks, len(self.chunks), self.contrast, dt)


def inside_strokes(loops: Loops, degree: int = DEGREE) -> Windows | None:
    """Detrended windows of consecutive rows inside strokes, away from their ends; None if they are short."""
    size = min(WINDOW, int(np.median(loops.strokes[1])) // 4)
    if size < max(degree + 3, DEGREE + 4):
        return None
    return _cut(loops, size, max(size // 4, 2), degree)


def whole_strokes(loops: Loops) -> Windows | None:
    """Short strokes as one window each; a stiffer curve is taken out, since far rows see the muscle's own.

    None where they are too few to tell: the median of a handful leaves out those with the most noise.
    """
    size = min(WINDOW, int(np.quantile(loops.strokes[1], 0.25)))
    windows = None if size < SHORT_DEGREE + 3 else _cut(loops, size, 0, SHORT_DEGREE)
    return None if windows is None or windows.chunks.size < FEWEST_TELL else windows


def _cut(loops: Loops, size: int, margin: int, degree: int) -> Windows | None:
    """Windows of so many rows, a margin away from the ends of strokes."""
    first, length = loops.strokes
    starts = [
        np.arange(f + margin, f + n - margin - size + 1, size)
        for f, n in zip(first, length, strict=True)
        if n >= size + 2 * margin
    ]
    rows = np.concatenate(starts) if starts else np.empty(0, dtype=np.int64)
    if len(rows) < 4:
        return None
    index = rows[:, None] + np.arange(size)
    index = index[~loops.censored[index].any(axis=1)]
    if len(index) < 4:
        return None
    dt = (loops.time_s[index[:, -1]] - loops.time_s[index[:, 0]]) / (size - 1)
    return _detrended(loops.force_N[index], loops.force_N[index].mean(axis=1), degree, dt[:, None])


def between_strokes(loops: Loops) -> Windows | None:
    """The same from differences of strokes that repeat each other; None where these are few or short.

    What the muscle does, and whatever is wrong with it, comes back in the next cycle; noise does not. A
    sampling clock that does not keep step with the drive leaves a smooth difference: the polynomial takes it.
    """
    pairs = _repeated(loops)
    if len(pairs) < FEWEST_PAIRS:
        return None
    begins = np.array([pair.begins for pair in pairs])
    rows_each = np.array([pair.rows for pair in pairs])
    # Long windows tell more than many: of strokes at two speeds the fast ones may be left out.
    size = min(LONG_WINDOW, int(np.quantile(rows_each, 0.5, method="higher")))
    if size < DEGREE + 4:
        return None
    counts = rows_each // size
    within = np.concatenate([np.arange(n) for n in counts]) * size
    margins = np.repeat((rows_each - counts * size) // 2, counts)
    starts = np.repeat(begins, counts, axis=0) + (margins + within)[:, None]
    rows = starts[:, :, None] + np.arange(size)
    force = loops.force_N - _shared_curves(loops)
    difference = (force[rows[:, 0]] - force[rows[:, 1]]) / np.sqrt(2.0)
    dt = np.sort(loops.time_s[rows[:, :, -1]] - loops.time_s[rows[:, :, 0]], axis=1) / (size - 1)
    windows = _detrended(difference, loops.force_N[rows].mean(axis=(1, 2)), DEGREE, dt)
    new = np.repeat(np.array([pair.new for pair in pairs]), counts)
    if new.any() and (~new).sum() >= FEWEST_PAIRS:
        first, others = (windows.chunks[which] ** 2 for which in (new, ~new))
        # Of noise that is correlated for some readings half of them tell anew.
        if stats.f.sf(first.mean() / others.mean(), first.size / 2, others.size / 2) < CHANCE:
            return windows.take(~new)
    return windows


def _shared_curves(loops: Loops) -> Array:
    """The curve (rows,), N, by place that all strokes of a level and branch share, each beside its own line.

    Where readings of two strokes lie apart, what it does between them would be left in their difference.
    """
    curve = np.zeros(len(loops.force_N))
    for level in np.unique(loops.level):
        for branch in np.unique(loops.branch):
            here = np.flatnonzero((loops.level == level) & (loops.branch == branch))
            x = loops.displacement_m[here]
            degree = min(CURVE_DEGREE, len(here) // CURVE_ROWS)
            if degree < 2 or np.ptp(x) == 0.0:
                continue
            x = 2.0 * (x - x.min()) / np.ptp(x) - 1.0
            shared = legvander(x, degree)[:, 2:]
            both = _without_lines(np.column_stack([shared, loops.force_N[here]]), x, loops.stroke[here])
            curve[here] = shared @ np.linalg.lstsq(both[:, :-1], both[:, -1], rcond=None)[0]
    return curve


def _without_lines(values: Array, x: Array, stroke: Ints) -> Array:
    """Values (rows, k) less each stroke's own line along x (rows,)."""
    starts = np.flatnonzero(np.diff(stroke, prepend=-1))
    sizes = np.diff(np.append(starts, len(x)))

    def mean(of: Array) -> Array:
        return np.repeat(np.add.reduceat(of, starts, axis=0) / sizes[:, None], sizes, axis=0)

    along = x[:, None] - mean(x[:, None])
    values = values - mean(values)
    return values - along * mean(along * values) / np.maximum(mean(along**2), 1e-12)


class Pair(NamedTuple):
    """Two strokes that repeat each other: from which rows on, for how many, and how far ``apart`` they lie.

    The last is the largest distance of two readings as a share of the stroke. In a ``new`` pair one is the
    first at its level: no turn preceded it, and friction may build up otherwise there.
    """

    begins: tuple[int, int]
    rows: int
    apart: float
    new: bool = False


def _repeated(loops: Loops) -> list[Pair]:
    """Pairs of strokes that repeat each other, each stroke in one at most.

    They have one level, one branch and one speed. Where each cycle has another speed there are none: then as
    many readings at the same places will do, as their difference is a smooth one too.
    """
    pairs = _paired(loops, PACE)
    return (
        pairs if len(pairs) >= FEWEST_PAIRS else [p for p in _paired(loops, np.inf) if p.apart <= 1.0 / ALIKE]
    )


def _paired(loops: Loops, pace_apart: float) -> list[Pair]:
    """Pairs of strokes of one level and branch, whose paces (logarithms) are so far apart at most."""
    first, length = loops.strokes
    step = (loops.time_s[first + length - 1] - loops.time_s[first]) / np.maximum(length - 1, 1)
    come = np.diff(loops.level[first], prepend=-1) != 0
    come |= np.diff(loops.clock[first], prepend=-1) != 0
    groups: dict[tuple[int, int], list[tuple[int, float, int, bool]]] = {}
    for f, n, dt, new in zip(first.tolist(), length.tolist(), step, come.tolist(), strict=True):
        if not loops.censored[f : f + n].any():
            own = (n, float(np.log(max(dt, 1e-9))), f, new)
            groups.setdefault((int(loops.level[f]), int(loops.branch[f])), []).append(own)
    pairs: list[Pair] = []
    for group in groups.values():
        waiting: list[tuple[int, float, int, bool]] = []
        for n, pace, begin, new in sorted(group):
            waiting = [w for w in waiting if n - w[0] <= max(1, n // ALIKE)]
            other = next((w for w in waiting if abs(pace - w[1]) <= pace_apart), None)
            if other is None:
                waiting.append((n, pace, begin, new))
            else:
                waiting.remove(other)
                pair = _aligned(loops.displacement_m, (other[2], other[0]), (begin, n))
                pairs.append(pair._replace(new=new or other[3]))
    return pairs


def _aligned(x: Array, short: tuple[int, int], long: tuple[int, int]) -> Pair:
    """Two strokes (begin and rows) side by side where their readings lie nearest to each other.

    A test's first stroke may lack the reading of the turn that others begin with.
    """
    (begin, n), (other, m) = short, long
    own = x[begin : begin + n]
    apart = np.abs(np.lib.stride_tricks.sliding_window_view(x[other : other + m], n) - own)
    offset = int(np.argmin(apart.mean(axis=1)))
    return Pair((begin, other + offset), n, float(apart[offset].max() / max(np.ptp(own), 1e-12)))


def _detrended(windows: Array, force: Array, degree: int, dt: Array) -> Windows:
    """Windows (k, size) less a polynomial, with their mean forces (k,) and time steps (k, 1 or 2)."""
    size = windows.shape[1]
    full, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, size), degree + 1), mode="complete")
    contrast = np.asarray(full[:, degree + 1 :], dtype=np.float64)
    steps = np.broadcast_to(np.maximum(dt, 1e-9), (len(windows), 2))
    return Windows(windows @ contrast, force, contrast, steps)
