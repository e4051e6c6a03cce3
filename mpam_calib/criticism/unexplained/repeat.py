"""Fine structure that comes back in every stroke: too fine for the reduced rows, but no noise.

Noise does not know where the crosshead is. What is left of the raw readings after a fit and a smooth curve
for each stroke is laid over itself by position: a ripple of the drive or a notch in the wall adds up, noise
does not.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy import stats

from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.fitting.fit import Fit, chain_for

Array = NDArray[np.float64]

DEGREE = 6
"""Degree of the curve that is taken out of each stroke."""
FEWEST = 10
"""Readings of a stroke that is long enough to be looked at."""
TOGETHER, FINEST = 8, 400
"""Readings that share a place on average, and the largest number of places."""
SHIFTS = 200
"""Random shifts that show what noise alone adds up to."""
SURE = 1e-9
"""Probability by which noise alone adds up to as much."""


def raw_residual(rows: Rows, blueprint_json: str, fitted: Fit) -> Array:
    """What a fit leaves of the raw readings, N (rows,).

    ``blueprint_json`` is the declared simulation that ``fitted`` extends.
    """
    chain = chain_for(blueprint_json, fitted.effects)
    values = {
        p.name: p.prior.from_normal(u[None, None]) for p, u in zip(chain.parameters, fitted.u, strict=True)
    }
    force = chain.force(values or {"": np.zeros((1, 1))}, fitted.eta[None, :], rows.readings)
    return np.asarray(rows.force - np.broadcast_to(force, (1, len(rows.force)))[0])


def repeating_rms(rows: Rows, residual: Array) -> float:
    """Root mean square (N) of the fine structure that a branch's strokes share; 0 where noise explains it.

    ``residual`` (rows,) is what a fit leaves, N. Strokes whose readings lie at other places tell it together,
    however few each has. What noise adds up to is told by the same residuals, each stroke's moved on by a
    random number of readings; a gamma distribution carries that on to where chance ends.
    """
    rng = np.random.default_rng(0)
    found = [0.0]
    for sign in np.unique(rows.readings.sign):
        strokes = _detrended(rows, residual, rows.readings.sign == sign)
        if len(strokes) < 3:
            continue
        left = np.concatenate([piece for _, piece in strokes])
        places = _places(np.concatenate([x for x, _ in strokes]))
        power = _shared(places, left)
        sizes = np.array([len(piece) for _, piece in strokes])
        begins = np.repeat(np.cumsum(sizes) - sizes, sizes)
        within = np.arange(len(left)) - begins
        chance = []
        for _ in range(SHIFTS):
            moved = np.repeat(rng.integers(0, sizes), sizes)
            chance.append(_shared(places, left[begins + (within + moved) % np.repeat(sizes, sizes)]))
        mean, variance = float(np.mean(chance)), float(np.var(chance))
        if variance > 0.0 and stats.gamma.sf(power, mean**2 / variance, scale=variance / mean) < SURE:
            found.append(power - mean)
    return float(np.sqrt(max(found)))


def _detrended(rows: Rows, residual: Array, here: NDArray[np.bool_]) -> list[tuple[Array, Array]]:
    """Places (m) and residuals (N) of each stroke of a branch, without turns, rests and a smooth curve."""
    found = []
    for s in np.unique(rows.stroke[here]):
        inside = rows.middle(s)
        if len(inside) >= FEWEST:
            x = rows.readings.displacement[inside]
            found.append((x, residual[inside] - Polynomial.fit(x, residual[inside], DEGREE)(x)))
    return found


def _places(x: Array) -> NDArray[np.int64]:
    """The place (rows,) of each reading among equal parts of the way."""
    count = int(np.clip(len(x) // TOGETHER, 1, FINEST))
    return np.searchsorted(np.linspace(x.min(), x.max(), count + 1)[1:-1], x)


def _shared(places: NDArray[np.int64], left: Array) -> float:
    """Mean square (N²) of what readings (rows,) at one place have in common."""
    sums, counts = np.bincount(places, left), np.bincount(places)
    return float(np.sum(sums**2 / np.maximum(counts, 1)) / len(left))
