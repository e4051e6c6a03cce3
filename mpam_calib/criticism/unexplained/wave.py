"""A wave in time: one frequency through the whole test, too slow for the spectra of single strokes.

A regulator that hunts swings the force a time or two in every stroke. Strokes do not share it, for each meets
it elsewhere; so no cause explains it, and a model of the noise may take it for noise that lasts. But it keeps
time from the first stroke to the last, which noise does not.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.criticism.data.rows import Rows

Array = NDArray[np.float64]

FEWEST, ALIKE = 6, 2
"""Readings of a stroke that is looked at, and strokes of a level and branch that tell what they share."""
FEWEST_STROKES = 20
"""Strokes that resolve a line: in twelve the spectrum of slow noise may be as narrow as one."""
DEGREE = 6
"""Degree, along the way, of the curve that strokes alike share."""
FINER, PADDED = 2, 2
"""Places in the spectrum's time for each time step, and the length of that time over the test's."""
MOST = 2_000_000
"""Places at the most."""
BEGIN, BESIDE = 4, 40
"""Frequencies on either side with which one is compared, from where to where, in those the test resolves."""
SURE = 1e-9
"""Probability by which smooth noise has such a line anywhere."""
SHARE = 0.25
"""Share of what is left from which on it is a wave: what differs from cycle to cycle has many lines."""


def wave_rms(rows: Rows, residual: Array) -> float:
    """Root mean square (N) of the strongest wave; 0 where there is none that matters.

    ``residual`` (rows,) is what a fit leaves, N. What strokes alike share at a place is taken out, and each
    stroke's mean and slope; the periodogram of the rest (Schuster 1898), all strokes on one clock, is
    compared with itself on either side. A pause as long as the test, or files whose clocks nothing ties
    together, can hide a wave; they make none.
    """
    time, left, strokes = _rest_of(rows, residual)
    if strokes < FEWEST_STROKES or not np.any(left):
        return 0.0
    # After a pause of days the spectrum's time has coarser places: there would be too many.
    step = max(float(np.median(np.diff(time))) / FINER, float(time[-1] - time[0]) / MOST)
    if step <= 0.0:
        return 0.0
    place = np.round((time - time[0]) / step).astype(np.int64)
    # Zeros behind the test: as many again, and frequencies half its resolution apart.
    power = np.abs(np.fft.rfft(np.bincount(place, left), PADDED * (int(place[-1]) + 1))) ** 2
    power = power[: len(power) // FINER]
    at, begin, end = int(power.argmax()), PADDED * BEGIN, PADDED * BESIDE
    beside = np.concatenate([power[max(at - end, 0) : max(at - begin, 0)], power[at + begin : at + end]])
    share = 2.0 * power[at] / (len(left) * float(left @ left))
    if share < SHARE or not len(beside):
        return 0.0
    # Two degrees of freedom for each frequency that the test resolves.
    odds = stats.f.sf(power[at] / np.mean(beside), 2, 2 * len(beside) // PADDED)
    if odds * len(power) >= SURE:
        return 0.0
    angle = 2.0 * np.pi * at * rows.readings.time / (PADDED * (int(place[-1]) + 1) * step)
    # Of a wave itself what is taken out is lost, too.
    kept = sum(np.mean(_rest_of(rows, turned(angle))[1] ** 2) for turned in (np.cos, np.sin))
    return float(np.sqrt(share * np.mean(left**2)) / kept)


def _rest_of(rows: Rows, residual: Array) -> tuple[Array, Array, int]:
    """Times (s) and residuals (N) of the readings that are looked at, less what is no wave; their strokes."""
    readings = rows.readings
    alike: dict[tuple[int, float], list[NDArray[np.intp]]] = {}
    for s in np.unique(rows.stroke):
        inside = rows.middle(s)
        if len(inside) >= FEWEST:
            key = int(readings.level[inside[0]]), float(readings.sign[inside[0]])
            alike.setdefault(key, []).append(inside)
    left, count = np.full(len(residual), np.nan), 0
    for strokes in (s for s in alike.values() if len(s) >= ALIKE):
        every = np.concatenate(strokes)
        left[every] = _less(readings.displacement[every], residual[every], DEGREE)
        for inside in strokes:
            left[inside] = _less(readings.time[inside], left[inside], 1)
        count += len(strokes)
    kept = np.flatnonzero(~np.isnan(left))
    kept = kept[np.argsort(readings.time[kept], kind="stable")]
    return readings.time[kept], left[kept], count


def _less(place: Array, values: Array, degree: int) -> Array:
    """Values (n,) less their polynomial of the place."""
    scaled = 2.0 * (place - place.min()) / max(float(np.ptp(place)), 1e-12) - 1.0
    columns = legendre.legvander(scaled, degree)
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])
