"""Where strokes are parted into bins: finer at their turns, never across the ends of a rest or of slack."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

FINE = np.array([0.25, 0.5, 0.75, 1.0, 1.5, 2.0])
"""The first bins of a stroke are divided further: friction turns over there."""
UNREDUCED = 16
"""Strokes of up to so many readings are left as they are."""
REST_BINS = 0.2
"""Bins of a stroke's rest, at most, for each one of its motion."""


@dataclass(frozen=True)
class Parting:
    """Bins (n,) of rows (N,) in time order, each inside one stroke.

    ``starts`` are their first rows and ``stops`` those after their last ones; ``segment`` is a bin's stroke,
    from 0, and ``position`` its place in that.
    """

    starts: Ints
    stops: Ints
    segment: Ints
    position: Ints

    @staticmethod
    def of(loops: Loops, rest: Bools, slack: Bools, most: int, finest: int) -> Parting:
        """About ``most`` bins a stroke, finer at its turn where these keep ``finest`` rows.

        ``rest`` and ``slack`` (N,) mark the rows where the crosshead stands still and those at the floor.
        """
        strokes, lengths = loops.strokes
        edges = [
            np.union1d(_edges(still, most, finest), np.flatnonzero(np.diff(floor, prepend=floor[0])))
            for still, floor in zip(np.split(rest, strokes[1:]), np.split(slack, strokes[1:]), strict=True)
        ]
        starts = np.concatenate([first + own for first, own in zip(strokes, edges, strict=True)])
        segment = np.repeat(np.arange(len(lengths)), [len(own) for own in edges])
        position = np.concatenate([np.arange(len(own)) for own in edges])
        return Parting(starts, np.append(starts[1:], len(rest)), segment, position)

    @property
    def rows(self) -> Ints:
        """How many rows each bin has."""
        return self.stops - self.starts

    def mean(self, values: Array) -> Array:
        """Means of values (N, ...) over each bin, (n, ...)."""
        count = self.rows.astype(np.float64).reshape(-1, *[1] * (values.ndim - 1))
        return np.asarray(np.add.reduceat(values, self.starts) / count)

    def weighted_mean(self, values: Array, weight: Array) -> Array:
        """Means (n,) of values (N,) by their weights (N,)."""
        sums = np.add.reduceat(weight * values, self.starts)
        return np.asarray(sums / np.add.reduceat(weight, self.starts))

    def spread(self, values: Array) -> Array:
        """Standard deviations (n,) of values (N,) inside the bins."""
        centre = np.repeat(self.mean(values), self.rows)
        return np.sqrt(self.mean((values - centre) ** 2))

    def wider(self, most: int) -> Ints:
        """First rows of bins of twice the width, where a stroke has all its ``most`` bins."""
        full = np.bincount(self.segment)[self.segment] > most
        kept = ~full | (self.position <= len(FINE)) | ((self.position - len(FINE)) % 2 == 1)
        return np.asarray(self.starts[kept])


def _edges(rest: Bools, most: int, finest: int) -> Ints:
    """First rows of the bins of a stroke: about ``most``, with finer first ones of ``finest`` rows or more.

    Rows (n,) at rest count less: however long a stroke dwells, its motion keeps most of the bins.
    """
    n = len(rest)
    moving = n - int(rest.sum())
    weight = np.where(rest & (moving > 0), min(1.0, REST_BINS * moving / max(n - moving, 1)), 1.0)
    rows = float(weight.sum())
    bins = int(np.ceil(rows)) if rows <= min(UNREDUCED, most) else min(most, max(UNREDUCED, int(rows) // 4))
    fractions = np.arange(bins, dtype=np.float64)
    if rows >= 4 * finest * bins:
        fractions = np.concatenate([[0.0], FINE, fractions[3:]])
    passed = np.concatenate([[0.0], np.cumsum(weight)])
    edges = np.round(np.interp(fractions / bins * rows, passed, np.arange(n + 1)))
    # Motion and the rests at a stroke's ends share no bin: their friction is another.
    ends = np.flatnonzero(~rest)[[0, -1]] + [0, 1] if moving else np.zeros(0)
    return np.unique(np.concatenate([edges, ends[ends < n]])).astype(np.int64)
