"""White noise alone: every row counts, through three pseudo-readings of each bin.

What the rows of a bin know of a force that bends like a parabola inside it, they say at the three nodes of
the Gauss rule of their own displacements; what scatters about their parabola knows the noise alone. So the
sum of squares over all rows is kept, and its cost does not depend on their number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings

Array = NDArray[np.float64]
LOG_2PI = float(np.log(2.0 * np.pi))
SIDES = np.array([-1.0, 0.0, 1.0])[:, None]


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
        skew, fourth = mean(x**3), np.maximum(mean(x**4), 1.0)
        bend = x**2 - wide[own] - skew[own] * x
        size = mean(bend**2)
        at = SIDES * np.sqrt(fourth) * wide
        parabola = at**2 - wide - skew * at

        def fit(z: Array) -> tuple[Array, Array]:
            """Values (3, m) of the bins' parabolas at the nodes, and what is left of the rows."""
            centre, slope = mean(z), mean(x * z)
            curve = mean(bend * z) * (size > 1e-9) / np.maximum(size, 1e-9)
            left = z - centre[own] - slope[own] * x - curve[own] * bend
            return centre + slope * at + curve * parabola, left

        at_nodes, left = fit(force)
        at_rows = Readings.join([rows.take(start)] * 3)
        moving = ("pressure", "displacement", "time", "file_time", "time_at_level", "travel", "speed")
        outer = 0.5 / fourth
        return Nodes(
            Readings(**{**vars(at_rows), **{name: fit(getattr(rows, name))[0].ravel() for name in moving}}),
            at_nodes.ravel(),
            (count * np.stack([outer, 1.0 - 2.0 * outer, outer])).ravel(),
            float(left @ left),
            len(force),
        )

    def interpolate(self, halves: Array | None, time: Array) -> Array | None:
        """What is known at the two halves of bins, (2n,), whose mean times are (2n,), at the nodes."""
        if halves is None:
            return None
        middle = halves.reshape(2, -1).mean(axis=0)
        return np.asarray(np.interp(self.readings.time, time[: len(middle)], middle))


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
