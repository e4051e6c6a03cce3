"""How moduli that are free at each level may go on where none was recorded, of which no law of theirs speaks.

Beyond all levels they change with the pressure as much as they did between the two last levels, or by as much
the other way; those of a single level, which cannot tell, by a share of themselves. Between two levels they
are interpolated, which misses what they bend: by as much, either way, as the parabola through each of the two
levels and its neighbours (Newton's divided difference) lies off the straight line. Where there are two levels
alone, which cannot tell either, by a share of the change from one to the other.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import Values
from mpam_calib.model.moduli import ModuliBlock
from mpam_calib.model.readings import Readings

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ALONE = 0.5
"""Of the moduli at a single level, the sd of their change from there to twice the pressure."""
BENT = 0.2
"""Of the change between two levels alone, the sd of what a straight line is off half way."""


def moduli_change(
    chain: Chain, values: Values, eta: Array, readings: Readings, unknown: Array
) -> Array | None:
    """Force (B, n), N, of such a change: 0 at the levels. None under a law.

    ``eta`` (B, p) are the moduli's coordinates, ``unknown`` (B, 2 + levels) standard normal deviates: for
    below all levels, for above, and one for how the moduli bend about each level. Where ``values`` are (B, n)
    all readings have one pressure.
    """
    levels = chain.setting.levels
    if chain.setting.simulation.law != "free":
        return None
    if levels[-1] <= 0.0:
        return np.zeros((len(eta), len(readings)))

    def pull(where: Ints, level: int) -> Array:
        # Readings of a level have its moduli whatever their pressure.
        rows = readings.take(where)
        return chain.force(values, eta, replace(rows, level=np.full(len(rows), level)))

    def bare(where: Ints) -> Array:
        return chain.force(values, np.zeros_like(eta), readings.take(where))

    return _Change(levels, readings.pressure, pull, bare, unknown).found()


def as_others_say(block: ModuliBlock, eta: Array, level: int, unknown: Array) -> Array:
    """Coordinates (B, p) of free moduli, one level's own what those of the others come to at its pressure.

    ``unknown`` (B, 1 + levels) are deviates for these others, as above.
    """
    levels, order = block.law.levels, block.law.order
    mean, matrix = block.transform({})
    every = block.coefficients(eta, {}).reshape(len(eta), len(levels), order)
    others, known = np.delete(levels, level), np.delete(every, level, axis=1)
    weights = np.array([np.interp(levels[level], others, one) for one in np.eye(len(others))])
    said = np.einsum("l,blk->bk", weights, known)
    pressure = np.full(order, levels[level])
    said += _Change(
        others, pressure, lambda where, k: known[:, k, where], lambda where: 0.0 * known[:, 0, where], unknown
    ).found()
    every[:, level] = said
    back = np.linalg.pinv(matrix[0])
    return np.asarray((every.reshape(len(eta), -1) - mean) @ back.T)


@dataclass(frozen=True)
class _Change:
    """What the moduli, or a force that goes with them, may change by at pressures (n,), Pa.

    ``at`` gives some of these with the moduli of one level, (B, some), ``bare`` with none; ``unknown`` as
    above.
    """

    levels: Array
    pressure: Array
    at: Callable[[Ints, int], Array]
    bare: Callable[[Ints], Array]
    unknown: Array

    def found(self) -> Array:
        """The change (B, n)."""
        P, levels = self.pressure, self.levels
        found = np.zeros((len(self.unknown), len(P)))
        last = len(levels) - 1
        for where, edge, z in (
            (np.flatnonzero((levels[0] > P) & (P >= 0.0)), 0, self.unknown[:, :1]),
            (np.flatnonzero(levels[last] < P), last, self.unknown[:, 1:2]),
        ):
            if len(where):
                found[:, where] = self._beyond(where, edge) * z
        for low in range(last):
            where = np.flatnonzero((levels[low] < P) & (levels[low + 1] > P))
            if len(where):
                found[:, where] = self._between(where, low)
        return found

    def _beyond(self, where: Ints, edge: int) -> Array:
        """One sd, beyond the level ``edge``."""
        P, levels = self.pressure[where], self.levels
        if len(levels) == 1:
            share = np.abs(P / levels[0] - 1.0)
            return np.asarray(ALONE * share * (self.at(where, 0) - self.bare(where)))
        inner = abs(edge - 1)
        steps = np.abs((P - levels[edge]) / (levels[edge] - levels[inner]))
        return np.asarray(steps * (self.at(where, edge) - self.at(where, inner)))

    def _between(self, where: Ints, low: int) -> Array:
        """The change itself, between the level ``low`` and the next."""
        P, levels, z, high = self.pressure[where], self.levels, self.unknown[:, 2:], low + 1
        at = {k: self.at(where, k) for k in range(max(low - 1, 0), min(high + 2, len(levels)))}
        share = (P - levels[low]) / (levels[high] - levels[low])
        if len(levels) == 2:
            return np.asarray(4.0 * BENT * share * (1.0 - share) * (at[high] - at[low]) * z[:, :1])
        # The nearer level says more of the bend; an outer one, with a single neighbour, nothing.
        weights = {low: 1.0 - share, high: share}
        told = {k: weight for k, weight in weights.items() if 0 < k < len(levels) - 1}
        bend = np.zeros((len(z), len(where)))
        for k, weight in told.items():
            before, after = levels[k] - levels[k - 1], levels[k + 1] - levels[k]
            each = ((at[k + 1] - at[k]) / after - (at[k] - at[k - 1]) / before) / (before + after)
            bend += np.sqrt(weight / sum(told.values())) * each * z[:, k : k + 1]
        return np.asarray((P - levels[low]) * (levels[high] - P) * bend)
