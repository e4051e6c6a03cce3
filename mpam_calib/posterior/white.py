"""White noise alone: every row counts, through three pseudo-readings of each bin.

What the rows of a bin know of a force that bends like a parabola inside it, they say at the three nodes of
the Gauss rule of their own displacements; what scatters about their parabola knows the noise alone. So the
sum of squares over all rows is kept, and its cost does not depend on their number.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings

Array = NDArray[np.float64]
LOG_2PI = float(np.log(2.0 * np.pi))
SIDES = np.array([-1.0, 0.0, 1.0])[:, None]


@dataclass(frozen=True)
class Nodes:
    """``readings`` and ``force`` (3n,), N: all lower nodes, all middles, all upper ones.

    ``weight`` (3n,) are the rows behind each, ``within`` (N²) is the sum of squares about the bins'
    parabolas, ``rows`` how many there are, ``reach`` (n,) how many spreads of a bin's rows lie between its
    middle and its outer nodes.
    """

    readings: Readings
    force: Array
    weight: Array
    within: float
    rows: int
    reach: Array

    @staticmethod
    def build(
        force: Array, pressure: Array, x: Array, start: NDArray[np.int64], middle: Readings, outward: Array
    ) -> Nodes:
        """From rows (N,) of force, pressure and displacement, and the bins' first rows and means (n,).

        ``outward`` (n,) is 1 where a bin's rows contract, else −1.
        """
        count = np.diff(np.append(start, len(force))).astype(np.float64)
        own = np.repeat(np.arange(len(start)), count.astype(np.int64))

        def mean(z: Array) -> Array:
            return np.asarray(np.add.reduceat(z, start) / count)

        dx = x - middle.displacement[own]
        spread = np.sqrt(mean(dx**2))
        wide = (spread > 0.0).astype(np.float64)
        x = dx / np.where(spread > 0.0, spread, 1.0)[own]
        # The polynomials that are orthogonal over the bin's rows, and the Gauss rule of their moments.
        skew, fourth = mean(x**3), np.maximum(mean(x**4), 1.0)
        bend = x**2 - wide[own] - skew[own] * x
        size = mean(bend**2)
        reach = np.sqrt(fourth) * wide
        at = SIDES * reach
        basis = at, at**2 - wide - skew * at

        def fit(z: Array) -> tuple[Array, Array]:
            """Values of the bins' parabolas at the nodes (3, n), and what is left of the rows."""
            centre = mean(z)
            slope, curve = mean(x * z), mean(bend * z) * (size > 1e-9) / np.maximum(size, 1e-9)
            line = centre[own] + slope[own] * x
            return centre + slope * basis[0] + curve * basis[1], z - line - curve[own] * bend

        at_nodes, left = fit(force)
        joined = Readings.join([middle] * 3)
        travel = middle.travel + outward * spread * at
        outer = 0.5 / fourth
        return Nodes(
            replace(
                joined,
                pressure=fit(pressure)[0].ravel(),
                displacement=(middle.displacement + spread * at).ravel(),
                travel=np.maximum(travel, 0.0).ravel(),
            ),
            at_nodes.ravel(),
            (count * np.stack([outer, 1.0 - 2.0 * outer, outer])).ravel(),
            float(left @ left),
            len(force),
            reach,
        )

    def between(self, halves: Array | None, outward: Array) -> Array | None:
        """What is known at the bins' halves (2n,: earlier rows, later rows), at the nodes instead."""
        if halves is None:
            return None
        first, last = np.split(halves, 2)
        return np.asarray(0.5 * (first + last) + SIDES * self.reach * 0.5 * outward * (last - first)).ravel()


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
        pairs = (columns[0, :, :, None] * columns[0, :, None, :]).reshape(-1, p * p)
        gram = ((weight * slope) @ pairs).reshape(-1, p, p)
        pull = (weight * residual) @ columns[0]
    else:
        weighted = weight[..., None] * columns
        gram = np.swapaxes(columns, 1, 2) @ (slope[..., None] * weighted)
        pull = np.einsum("bnk,bn->bk", weighted, np.broadcast_to(residual, weighted.shape[:2]))
    squares = nodes.within + residual**2 @ nodes.weight
    constant = squares / variance + nodes.rows * (np.log(variance) + LOG_2PI)
    return gram / variance[:, None, None], pull / variance[:, None], constant
