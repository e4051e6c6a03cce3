"""How moduli that are free at each level may go on where none was recorded, of which no law of theirs speaks.

Beyond all levels they change with the pressure as much as they did between the two last levels, or by as much
the other way; those of a single level, which cannot tell, by a share of themselves. Between two levels they
are interpolated, which misses what they bend: by as much, either way, as the parabola through each of the two
levels and its neighbours (Newton's divided difference) lies off the straight line. Where there are two levels
alone, which cannot tell either, by a share of the change from one to the other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import Values
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
    if chain.setting.simulation.law != "free":
        return None
    found = np.zeros((len(eta), len(readings)))
    if chain.setting.levels[-1] > 0.0:
        change = _Change(chain, values, eta, readings)
        change.add_below(found, unknown[:, :1])
        change.add_above(found, unknown[:, 1:2])
        change.add_between(found, unknown[:, 2:])
    return found


@dataclass(frozen=True)
class _Change:
    """Adds to a force (B, n), N, what the moduli may change, ``z`` (B, 1 or levels) times its sd."""

    chain: Chain
    values: Values
    eta: Array
    readings: Readings

    @property
    def levels(self) -> Array:
        return self.chain.setting.levels

    def add_below(self, found: Array, z: Array) -> None:
        P = self.readings.pressure
        self._add_beyond(found, np.flatnonzero((self.levels[0] > P) & (P >= 0.0)), 0, 1, z)

    def add_above(self, found: Array, z: Array) -> None:
        last = len(self.levels) - 1
        self._add_beyond(found, np.flatnonzero(self.levels[-1] < self.readings.pressure), last, last - 1, z)

    def _add_beyond(self, found: Array, where: Ints, edge: int, inner: int, z: Array) -> None:
        if not len(where):
            return
        levels, P = self.levels, self.readings.pressure[where]
        if len(levels) == 1:
            rows = self.readings.take(where)
            bladder = self._at(where, 0) - self.chain.force(self.values, np.zeros_like(self.eta), rows)
            found[:, where] += ALONE * np.abs(P / levels[0] - 1.0) * bladder * z
            return
        steps = np.abs((P - levels[edge]) / (levels[edge] - levels[inner]))
        found[:, where] += steps * (self._at(where, edge) - self._at(where, inner)) * z

    def add_between(self, found: Array, z: Array) -> None:
        P, levels = self.readings.pressure, self.levels
        inner = range(1, len(levels) - 1)
        for low in range(len(levels) - 1):
            high = low + 1
            where = np.flatnonzero((levels[low] < P) & (levels[high] > P))
            if not len(where):
                continue
            near = range(max(low - 1, 0), min(high + 2, len(levels)))
            at = {k: self._at(where, k) for k in near}
            share = (P[where] - levels[low]) / (levels[high] - levels[low])
            if not inner:
                found[:, where] += 4.0 * BENT * share * (1.0 - share) * (at[high] - at[low]) * z[:, :1]
                continue
            room = (P[where] - levels[low]) * (levels[high] - P[where])
            # The nearer level says more of the bend; an outer one, with a single neighbour, nothing.
            weights = {low: 1.0 - share, high: share}
            told = {k: weights[k] for k in (low, high) if k in inner}
            for k, weight in told.items():
                before, after = levels[k] - levels[k - 1], levels[k + 1] - levels[k]
                bend = (at[k + 1] - at[k]) / after - (at[k] - at[k - 1]) / before
                sd = np.sqrt(weight / sum(told.values())) * room * bend / (before + after)
                found[:, where] += sd * z[:, k : k + 1]

    def _at(self, where: Ints, level: int) -> Array:
        """Force of the moduli of one level: readings of a level have these whatever their pressure."""
        rows = self.readings.take(where)
        return self.chain.force(self.values, self.eta, replace(rows, level=np.full(len(rows), level)))
