"""Chatter: one way the readings scatter far more than on the way back, at the same pace.

A load cell does not know which way a muscle moves. A braid that sticks and slips does (Rabinowicz 1965), and
where it slips elsewhere in every cycle it passes for noise, in half of the strokes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.unexplained.bursts import SD, detrended

Array = NDArray[np.float64]

PACE = 0.1
"""Paces differ where the logarithms of time steps have a gap of this width."""
FEWEST = 8
"""Strokes there and back, at one pace, that can be so sure: 16 in order have 12,870 ways to be parted."""
TIMES = 2.0
"""Ratio of the scatters from which on it counts: forces, and what grows with them, differ by less."""
SURE = 1e-4
"""Probability by which strokes of one scatter would be parted so well by chance (Mann and Whitney 1947)."""


def chatter_rms(rows: Rows, residual: Array, sd: Array) -> float:
    """Root mean square (N) of what one way has above the other, at the pace that has most; 0 without.

    ``residual`` (rows,) is what a fit leaves, N; ``sd`` (rows,) is how the noise of a reading grows.
    """
    strokes = [
        (float(np.median(np.diff(rows.readings.time[here]))), rows.readings.sign[here.start], _scatter(piece))
        for here, piece in detrended(rows, residual / sd)
    ]
    if not strokes:
        return 0.0
    step, sign, scatter = np.array(strokes).T
    order = np.argsort(step, kind="stable")
    log = np.log(np.maximum(step[order], 1e-9))
    paces = np.split(order, np.flatnonzero(np.diff(log) > PACE) + 1)
    excess = [_excess(scatter[p][sign[p] > 0.0], scatter[p][sign[p] < 0.0]) for p in paces]
    return max(excess) * float(np.mean(sd))


def _scatter(piece: Array) -> float:
    """Standard deviation of most of a stroke's readings: what a fit leaves next to a turn is not theirs."""
    return SD * float(np.median(np.abs(piece)))


def _excess(there: Array, back: Array) -> float:
    """What the strokes of one way scatter above those of the other; 0 where both are alike."""
    if min(len(there), len(back)) < FEWEST:
        return 0.0
    less, more = sorted((there, back), key=lambda scatter: float(np.median(scatter)))
    low, high = float(np.median(less)), float(np.median(more))
    if high <= TIMES * low or stats.mannwhitneyu(more, less, alternative="greater").pvalue > SURE:
        return 0.0
    return float(np.sqrt(high**2 - low**2))
