"""A hum: one frequency in the readings, mains or a pump, too fast for the reduced rows and no noise.

Noise has a smooth spectrum, however correlated it is; a hum has a line in it. Sampled slowly it is aliased
and passes for white noise in any mean over a few readings.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.unexplained.bursts import detrended

Array = NDArray[np.float64]

FEWEST, LONGEST = 24, 256
"""Readings of a stroke that is looked at, and of a piece of one whose spectrum is taken."""
SHORT = 0.5
"""Share of the strokes, the shortest, whose spectra would be too coarse and are left out."""
PACE = 0.1
"""Strokes are of one pace where their time steps differ by less than this share."""
GAP = 1.5
"""Time steps, in the usual one, beyond which readings are missing."""
SLOWEST = 4
"""Cycles a stroke: what is slower the reduced rows see, and the curve taken out of each stroke has."""
STEEPEST = 4
"""Power of the frequency by which noise falls behind a filter of second order."""
BESIDE, FEW, NEXT = 5, 3, 2
"""Frequencies on either side with which a line is compared, at least so many, and how far away they begin."""
ABOVE = 4.0
"""A line's power in that beside it: noise that resonates has broad peaks."""
SURE = 1e-9
"""Probability by which smooth noise has such a line anywhere."""
SIZE = 0.5
"""Root mean square, in the noise's, below which it does not matter."""


def hum_rms(rows: Rows, residual: Array) -> float:
    """Root mean square (N) of the strongest hum; 0 where there is none that matters.

    ``residual`` (rows,) is what a fit leaves, N. Spectra of strokes of one pace are averaged (Welch 1967); a
    line is a frequency with far more power than those on either side, by an F test against the larger.
    """
    groups = _paces(rows, residual)
    tests = sum(len(_spectrum(alike)[0]) for alike in groups)
    return max([0.0, *(_line(alike, SURE / tests) for alike in groups)])


def _paces(rows: Rows, residual: Array) -> list[list[Array]]:
    """Strokes without turns and smooth curves, by the time step of their readings."""
    groups: dict[float, list[Array]] = {}
    for here, piece in detrended(rows, residual):
        steps = np.diff(rows.readings.time[here])
        usual = float(np.median(steps)) if len(steps) else 0.0
        if len(piece) >= FEWEST and usual > 0.0 and steps.max() <= GAP * usual:
            pace = next((p for p in groups if abs(usual / p - 1.0) < PACE), usual)
            groups.setdefault(pace, []).append(piece)
    return list(groups.values())


def _spectrum(strokes: list[Array]) -> tuple[Array, int, float]:
    """Mean periodogram of pieces of the longer strokes, how many there are, and what a sine gathers."""
    length = min(LONGEST, int(np.quantile([len(s) for s in strokes], SHORT, method="lower")))
    pieces = np.array([s[i : i + length] for s in strokes for i in range(0, len(s) - length + 1, length)])
    window = np.hanning(length + 2)[1:-1]
    power = np.mean(np.abs(np.fft.rfft(pieces * window, axis=1)) ** 2, axis=0) / np.sum(window**2)
    return power, len(pieces), float(np.sum(window) ** 2 / np.sum(window**2))


def _line(strokes: list[Array], sure: float) -> float:
    """Root mean square (N) of the clearest line in the spectrum of some strokes; 0 where none is sure."""
    sizes = np.array([np.sqrt(np.mean(s**2)) for s in strokes])
    if sizes.min() <= 0.0:
        return 0.0
    # Louder strokes are not to count for more: there would be fewer than the test supposes.
    power, pieces, gathered = _spectrum([s / size for s, size in zip(strokes, sizes, strict=True)])
    found = 0.0
    for i in range(SLOWEST, len(power)):
        slower = power[max(i - NEXT - BESIDE + 1, SLOWEST) : i - NEXT + 1]
        faster = np.arange(i + NEXT, min(i + NEXT + BESIDE, len(power)))
        beside = [float(np.mean(slower))] if len(slower) >= FEW else []
        if len(faster) >= FEW:
            steep = 1.0 if beside else (faster / i) ** STEEPEST
            beside.append(float(np.mean(power[faster] * steep)))
        if not beside:
            continue
        # A periodogram's ordinate has two degrees of freedom; the window shares them between neighbours.
        odds = stats.f.sf(power[i] / max(beside), 2 * pieces, BESIDE * pieces)
        if odds < sure and power[i] > ABOVE * max(beside):
            found = max(found, float(np.sqrt(2.0 * (power[i] - max(beside)) / gathered)))
    return found * float(np.sqrt(np.mean(sizes**2))) if found > SIZE else 0.0
