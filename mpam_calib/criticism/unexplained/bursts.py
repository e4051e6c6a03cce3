"""Bursts and drop-outs: readings that stand out of their own stroke, where nothing is that fast.

A muscle's force, and whatever is wrong with it, is smooth along a stroke away from its turns, and comes back
in the next one. A loose plug does neither. Nor is it noise, whose means over a few readings keep to a normal
distribution, or have tails that fall away gradually; it would only make the noise seem larger than it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import ndimage, stats

from mpam_calib.criticism.data.rows import Rows

Array = NDArray[np.float64]

FEWEST, READINGS_EACH, DEGREE = 10, 8, 6
"""Readings of a stroke that is looked at, those to each degree of the curve taken out of it, most degrees."""
TURNS = 0.05
"""Share of a stroke next to each turn that is not looked at."""
WIDTHS = (1, 3, 6)
"""Consecutive readings that are looked at together."""
OUTSTANDING = 6.0
"""Standard deviations of such means beyond which readings are no noise: one in 5·10⁸."""
HALF_WAY, FEWER = 3.0, 3.0
"""Standard deviations from which on readings are less far out, and how many of them tails have for each
that stands out; of Student's t with five degrees of freedom fifteen, of spikes one or none."""
SIZE = 0.2
"""Root mean square of them all, in the noise's sd, below which they do not matter."""
SD = 1.4826
"""Standard deviation of normal noise in its median size."""


def bursts_rms(rows: Rows, residual: Array, sd: Array) -> float:
    """Root mean square (N, over all readings) of those in bursts; 0 where there are none that matter.

    ``residual`` (rows,) is what a fit leaves, N; ``sd`` (rows,) is how the noise of a reading grows.
    """
    groups = _strokes(rows, residual / sd)
    left = [piece for alike in groups for piece in alike]
    if not left:
        return 0.0
    every = np.concatenate(left)
    # What other strokes have at the same place, too, is no burst, however sharp.
    own = [piece - usual for alike in groups for piece, usual in zip(alike, _of_others(alike), strict=True)]
    stand_out = np.zeros(len(every), dtype=bool)
    for width in WIDTHS:
        most = np.inf if width == 1 else OUTSTANDING * SD * float(np.median(np.abs(every)))
        here, beside = (np.concatenate([_mean(piece, width, most) for piece in kind]) for kind in (left, own))
        if width == 1 and _tails(here):
            continue
        least = OUTSTANDING * SD * np.median(np.abs(here))
        high = (np.abs(here) > least) & (np.abs(beside) > least) & (here * beside > 0.0)
        stand_out |= ndimage.maximum_filter1d(high, width)
    share = float(np.sqrt(np.mean(np.where(stand_out, every, 0.0) ** 2)))
    noise = SD * float(np.median(np.abs(every)))
    return share * float(np.mean(sd)) if share > SIZE * noise else 0.0


def _tails(every: Array) -> bool:
    """Whether the readings (n,) that stand out are the ends of long tails, as of Student's t.

    Tails fall away gradually: for each reading far out there are many less far out. Of spikes there are not.
    """
    size = np.abs(every) / (SD * np.median(np.abs(every)))
    less = np.sum((size > HALF_WAY) & (size <= OUTSTANDING)) - len(every) * 2.0 * stats.norm.sf(HALF_WAY)
    return bool(less > FEWER * np.sum(size > OUTSTANDING))


def _mean(piece: Array, width: int, most: float) -> Array:
    """Means over some consecutive readings, of which none counts for more than the ``most``: it would be a
    burst by itself. They are told in what white noise scatters there."""
    means = ndimage.uniform_filter1d(np.clip(piece, -most, most), width, mode="constant")
    return np.asarray(means / _scatter(len(piece), width))


@lru_cache(maxsize=1024)
def _scatter(n: int, width: int) -> Array:
    """Sds (n,) of means over so many readings of a detrended stroke, for white noise of sd 1.

    Of a short stroke the curve that is taken out has most of these means but for those at its ends. Nowhere
    less than their median: next to its turns a force may be fast itself.
    """
    axes, _ = np.linalg.qr(_curve(n))
    seen = ndimage.uniform_filter1d(np.ones(n), width, mode="constant") / width
    taken = ndimage.uniform_filter1d(axes, width, axis=0, mode="constant")
    sd = np.sqrt(np.maximum(seen - np.sum(taken**2, axis=1), 0.0))
    return np.asarray(np.maximum(sd, np.median(sd)))


def _curve(n: int) -> Array:
    """The smooth functions (n, degree + 1) that are taken out of a stroke of n readings."""
    return np.asarray(legendre.legvander(np.linspace(-1.0, 1.0, n), min(DEGREE, n // READINGS_EACH)))


def _strokes(rows: Rows, residual: Array) -> list[list[Array]]:
    """The residuals of each stroke without its turns, less a smooth curve, by level and branch."""
    groups: dict[tuple[int, float], list[Array]] = {}
    for here, piece in detrended(rows, residual):
        alike = int(rows.readings.level[here.start]), float(rows.readings.sign[here.start])
        groups.setdefault(alike, []).append(piece)
    return list(groups.values())


def detrended(rows: Rows, residual: Array) -> Iterator[tuple[slice, Array]]:
    """Each stroke without its turns: its place among the readings, and its residuals less a smooth curve.

    Nor with the rests at its ends: where friction fades at a dead stop the force is as fast as in a burst.
    """
    first = np.flatnonzero(np.diff(rows.stroke, prepend=-1))
    for start, stop in pairwise([*first.tolist(), len(residual)]):
        margin = int(np.ceil(TURNS * (stop - start)))
        moving = start + np.flatnonzero(~rows.rest[start:stop])
        if not len(moving):
            continue
        here = slice(max(start + margin, int(moving[0])), min(stop - margin, int(moving[-1]) + 1))
        piece = residual[here]
        if len(piece) >= FEWEST:
            columns = _curve(len(piece))
            yield here, piece - columns @ np.linalg.lstsq(columns, piece, rcond=None)[0]


def _of_others(alike: list[Array]) -> list[Array]:
    """For each stroke the median of the others at the same places; zeros where there are none."""
    if len(alike) == 1:
        return [np.zeros(len(alike[0]))]
    places = [np.linspace(0.0, 1.0, len(piece)) for piece in alike]
    grid = max(places, key=len)
    table = np.array([np.interp(grid, at, piece) for at, piece in zip(places, alike, strict=True)])
    medians = (np.median(np.delete(table, i, axis=0), axis=0) for i in range(len(alike)))
    return [np.interp(at, grid, usual) for at, usual in zip(places, medians, strict=True)]
