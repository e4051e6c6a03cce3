"""What a model is asked about: a row of readings, whether measured or imagined, in SI units."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.specimen.recording import ForceMap

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Readings:
    """Rows (n,) that a force is wanted for.

    ``sign`` is s: +1 loading, −1 unloading, 0 neither; ``level`` is −1 where no level is meant;
    ``time`` runs over the whole test, ``file_time`` on its file's own clock and ``time_at_level`` since the
    level was reached (s);
    ``cycle`` counts from 1 within a level and ``test_cycle`` over the whole test; ``travel`` is the
    distance since the last reversal (m) and ``reversal`` 0 on a stroke that no reversal began;
    ``strokes_before`` (n, 2) are the lengths (m) of the stroke before and of the one before that, of
    whatever level (FAR where there was none); ``behind`` is
    how far (m) the reading lies short of the longest contraction that the test had reached; ``relaxed``
    (n, len(TIMES)) is what relaxation with each of these time constants has lost since every step of
    pressure that was made, over the pressure; ``speed``
    (m/s, 0: at rest) is the crosshead's at the reading, ``pace`` that of its whole stroke.
    """

    pressure: Array
    displacement: Array
    sign: Array
    level: Ints
    time: Array
    file_time: Array
    time_at_level: Array
    cycle: Array
    test_cycle: Array
    travel: Array
    reversal: Array
    strokes_before: Array
    behind: Array
    relaxed: Array
    speed: Array
    pace: Array

    def __len__(self) -> int:
        return len(self.pressure)

    def take(self, index: NDArray[np.generic] | slice) -> Readings:
        """The rows picked by an index, a mask or a slice."""
        return Readings(**{f.name: getattr(self, f.name)[index] for f in fields(self)})

    def middles(self) -> Readings:
        """One reading per row, where the first and the second half (n,) are two places in each row."""
        n = len(self) // 2
        low, high = self.take(slice(0, n)), self.take(slice(n, None))
        return replace(
            low,
            displacement=0.5 * (low.displacement + high.displacement),
            travel=0.5 * (low.travel + high.travel),
            behind=0.5 * (low.behind + high.behind),
        )

    @staticmethod
    def join(parts: list[Readings]) -> Readings:
        """One set of rows out of several."""
        return Readings(
            **{f.name: np.concatenate([getattr(p, f.name) for p in parts]) for f in fields(Readings)}
        )

    @staticmethod
    def at_rest(pressure: Array, displacement: Array, sign: Array | float = 0.0) -> Readings:
        """Rows without a history: settled after many cycles, far from a reversal, no clock.

        ``pressure`` (Pa), ``displacement`` (m) and ``sign`` broadcast together to shape (n,).
        """
        p, x, s = (np.asarray(v, dtype=np.float64) for v in np.broadcast_arrays(pressure, displacement, sign))
        zero = np.zeros(p.shape)
        return Readings(
            pressure=p,
            displacement=x,
            sign=s,
            level=np.full(p.shape, -1, dtype=np.int64),
            time=zero,
            file_time=zero,
            time_at_level=zero,
            cycle=zero + SETTLED,
            test_cycle=zero + SETTLED,
            travel=zero + FAR,
            reversal=zero,
            strokes_before=np.full((*p.shape, 2), FAR),
            behind=zero + FAR,
            relaxed=np.zeros((*p.shape, len(TIMES))),
            speed=zero,
            pace=zero,
        )

    def settled(self) -> Readings:
        """The same places (n,) at their levels, without a history: see :meth:`at_rest`."""
        return replace(Readings.at_rest(self.pressure, self.displacement, self.sign), level=self.level)

    @staticmethod
    def of_map(grid: ForceMap, L0: float) -> Readings:
        """The rows of a force map (n,) of a muscle of length L0 (m), each on its branch."""
        sign = np.where(np.abs(grid.branch) == 1, grid.branch, 0).astype(np.float64)
        rows = Readings.at_rest(grid.pressure_Pa, grid.contraction * L0, sign)
        return replace(rows, level=grid.level)


TIMES = 10.0 ** np.arange(0.0, 4.0, 0.5)
"""Time constants (s) for which ``relaxed`` is kept."""
SETTLED = 1e6
"""Cycle count that stands for "after many cycles"."""
FAR = 1e3
"""Distance (m) that stands for "far from the last reversal", and from what was never stretched before."""
