"""White noise alone: every row counts, through three pseudo-readings of each bin.

What the rows of a bin know of a force that bends like a parabola inside it, they say at the three nodes of
the Gauss rule of their own displacements; what scatters about their parabola knows the noise alone. So the
sum of squares over all rows is kept, and its cost does not depend on their number. Where the force has no
memory, strokes that repeat each other share their bins, and it does not depend on the number of cycles.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings
from mpam_calib.posterior.likelihood.algebra import LOG_2PI

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
ALIKE = 3e-4
"""Share of the highest pressure by which those of strokes that repeat each other may differ."""


@dataclass(frozen=True)
class Nodes:
    """``readings`` and ``force`` (3m,), N: all earlier nodes, all middles, all later ones.

    ``weight`` (3m,) are the rows behind each, ``within`` (N²) is the sum of squares about the bins'
    parabolas, ``rows`` how many there are.
    """

    readings: Readings
    force: Array
    weight: Array
    within: float
    rows: int
    group: Ints | None = None
    """(3m,) which strokes share the bin, where some do."""

    @staticmethod
    def build(force: Array, rows: Readings, start: NDArray[np.int64]) -> Nodes:
        """From all rows (N,) and the first row of each bin (m,)."""
        count = np.diff(np.append(start, len(force))).astype(np.float64)
        own = np.repeat(np.arange(len(start)), count.astype(np.int64))

        def mean(z: Array) -> Array:
            return np.asarray(np.add.reduceat(z, start) / count)

        # The displacement in units of its spread, later rows above zero.
        x = rows.displacement - mean(rows.displacement)[own]
        spread = np.sqrt(mean(x**2))
        last = np.append(start[1:], len(force)) - 1
        scale = np.where(spread > 0.0, spread, 1.0) * np.where(x[last] < 0.0, -1.0, 1.0)
        x = x / scale[own]
        # The polynomials that are orthogonal over the bin's rows, and the Gauss rule of their moments.
        wide = (spread > 0.0).astype(np.float64)
        skew = mean(x**3)
        bend = x**2 - wide[own] - skew[own] * x
        size = mean(bend**2)
        drift = mean(x * bend**2) * (size > 1e-9) / np.maximum(size, 1e-9)
        at, share = _gauss_rule(wide, skew, size, drift)
        parabola = at**2 - wide - skew * at

        def fit(z: Array) -> tuple[Array, Array]:
            """Values (3, m) of the bins' parabolas at the nodes, and what is left of the rows."""
            centre, slope = mean(z), mean(x * z)
            curve = mean(bend * z) * (size > 1e-9) / np.maximum(size, 1e-9)
            left = z - centre[own] - slope[own] * x - curve[own] * bend
            return centre + slope * at + curve * parabola, left

        at_nodes, left = fit(force)
        at_rows = Readings.join([rows.take(start)] * 3)
        moving = (
            "pressure",
            "displacement",
            "time",
            "file_time",
            "time_at_level",
            "travel",
            "behind",
            "speed",
        )
        moved = {name: fit(getattr(rows, name))[0].ravel() for name in moving}
        moved["relaxed"] = np.stack([fit(one)[0].ravel() for one in rows.relaxed.T], axis=1)
        return Nodes(
            Readings(**{**vars(at_rows), **moved}),
            at_nodes.ravel(),
            (count * share).ravel(),
            float(left @ left),
            len(force),
        )

    @staticmethod
    def of_repeated(force: Array, rows: Readings, segment: Ints, most: int) -> Nodes | None:
        """The same with at most ``most`` bins for all strokes that repeat each other; None where none do.

        ``segment`` (N,) numbers the strokes from 0. A repeated stroke has the level, the branch and the mean
        pressure of another. Only for forces that depend on pressure, place and direction alone.
        """
        first = np.flatnonzero(np.diff(segment, prepend=-1))
        mean = np.bincount(segment, rows.pressure) / np.bincount(segment)
        step = ALIKE * max(float(np.abs(rows.pressure).max()), 1e-9)
        kind = np.stack([rows.level[first], rows.sign[first], np.round(mean / step)], axis=1)
        group = np.unique(kind, axis=0, return_inverse=True)[1].ravel()
        if group.max() + 1 == len(group):
            return None
        own = group[segment]
        low, high = np.full(group.max() + 1, np.inf), np.full(group.max() + 1, -np.inf)
        np.minimum.at(low, own, rows.displacement)
        np.maximum.at(high, own, rows.displacement)
        share = (rows.displacement - low[own]) / np.maximum(high - low, 1e-12)[own]
        cell = own * most + np.minimum((share * most).astype(np.int64), most - 1)
        order = np.lexsort((rows.displacement, cell))
        start = np.flatnonzero(np.diff(cell[order], prepend=-1))
        nodes = Nodes.build(force[order], rows.take(order), start)
        return replace(nodes, group=np.tile(own[order][start], 3))

    def interpolate(self, halves: Array | None, bins: Readings, segment: Ints) -> Array | None:
        """What is known at the two halves of bins, (2n,), of strokes (n,), at the nodes (3m,)."""
        if halves is None:
            return None
        n = len(segment)
        middle = halves.reshape(2, -1).mean(axis=0)
        if self.group is None:
            return np.asarray(np.interp(self.readings.time, bins.time[:n], middle))
        place = bins.displacement.reshape(2, -1).mean(axis=0)
        result = np.empty(len(self.force))
        for one in np.unique(self.group):
            at = np.flatnonzero(self.group == one)
            alike = (bins.level[:n] == self.readings.level[at[0]]) & (
                bins.sign[:n] == self.readings.sign[at[0]]
            )
            # One of the strokes is enough: they repeat each other.
            near = np.abs(bins.pressure[:n] - self.readings.pressure[at[0]])
            alike &= segment == segment[np.argmin(np.where(alike, near, np.inf))]
            order = np.argsort(place[alike])
            result[at] = np.interp(self.readings.displacement[at], place[alike][order], middle[alike][order])
        return result


def _gauss_rule(wide: Array, skew: Array, size: Array, drift: Array) -> tuple[Array, Array]:
    """Nodes and weights (3, m), exact to the fifth degree, of measures with these recurrences (m,).

    Golub and Welsch 1969 (doi:10.1090/S0025-5718-69-99647-1).
    """
    jacobi = np.zeros((len(wide), 3, 3))
    jacobi[:, 0, 1] = jacobi[:, 1, 0] = wide
    jacobi[:, 1, 2] = jacobi[:, 2, 1] = np.sqrt(size)
    jacobi[:, 1, 1], jacobi[:, 2, 2] = skew, drift
    at, vectors = np.linalg.eigh(jacobi)
    return at.T, vectors[:, 0].T ** 2


def white_terms(
    nodes: Nodes, averaged: int, fixed: Array, slope: Array, columns: Array, white: Array
) -> tuple[Array, Array, Array]:
    """Aᵀ C⁻¹ A, Aᵀ C⁻¹ r and rᵀ C⁻¹ r + ln|C| + n ln 2π for A = slope·columns and noise sds ``white`` (B,).

    Columns that are alike for all B parameter vectors cost one product of all of them.
    """
    variance = white**2 / averaged
    residual = nodes.force - fixed
    weight = slope * nodes.weight
    p = columns.shape[-1]
    if len(columns) == 1:
        i, j = np.triu_indices(p)
        gram = np.empty((len(white), p, p))
        gram[:, i, j] = gram[:, j, i] = (weight * slope) @ (columns[0][:, i] * columns[0][:, j])
        pull = (weight * residual) @ columns[0]
    else:
        weighted = weight[..., None] * columns
        gram = np.swapaxes(columns, 1, 2) @ (slope[..., None] * weighted)
        pull = np.einsum("bnk,bn->bk", weighted, np.broadcast_to(residual, weighted.shape[:2]))
    squares = nodes.within + residual**2 @ nodes.weight
    constant = squares / variance + nodes.rows * (np.log(variance) + LOG_2PI)
    return gram / variance[:, None, None], pull / variance[:, None], constant
