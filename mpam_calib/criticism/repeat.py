"""Fine structure that comes back in every stroke: too fine for the reduced rows, but no noise.

Noise does not know where the crosshead is. What is left of the raw readings after a fit and a smooth curve
for each stroke is laid over itself by position: a ripple of the drive or a notch in the wall adds up, noise
does not.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from mpam_calib.criticism.fit import Fit, chain_for
from mpam_calib.criticism.rows import Rows

Array = NDArray[np.float64]

DEGREE = 6
"""Degree of the curve that is taken out of each stroke."""
FEWEST = 24
"""Readings of a stroke that is long enough to be looked at."""
AWAY = 0.9
"""Middle share of a stroke that is looked at."""
SHIFTS = 200
"""Random shifts that show what noise alone adds up to."""
SURE = 6.0
"""Standard deviations above that."""


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

    ``residual`` (rows,) is what a fit leaves, N.
    """
    rng = np.random.default_rng(0)
    found = [0.0]
    for sign in np.unique(rows.readings.sign):
        profiles = _profiles(rows, residual, rows.readings.sign == sign)
        if profiles is None:
            continue
        power = _shared(profiles)
        strokes, grid = profiles.shape
        shifted = (np.arange(grid) + rng.integers(0, grid, (SHIFTS, strokes, 1))) % grid
        chance = _shared(profiles[np.arange(strokes)[:, None], shifted])
        if power > np.mean(chance) + SURE * np.std(chance):
            found.append(float(power - np.mean(chance)))
    return float(np.sqrt(max(found)))


def _profiles(rows: Rows, residual: Array, here: NDArray[np.bool_]) -> Array | None:
    """Detrended residuals of a branch's strokes on one grid of positions, (strokes, grid)."""
    strokes, counts = np.unique(rows.stroke[here], return_counts=True)
    strokes = strokes[counts >= FEWEST]
    moves = [np.ptp(rows.readings.displacement[rows.stroke == s]) > 0.0 for s in strokes]
    strokes = strokes[np.array(moves, dtype=bool)]
    if len(strokes) < 3:
        return None
    reach = float(np.quantile([rows.readings.displacement[rows.stroke == s].max() for s in strokes], 0.1))
    grid = np.linspace(
        0.5 * (1.0 - AWAY) * reach,
        0.5 * (1.0 + AWAY) * reach,
        int(np.clip(np.median(counts[counts >= FEWEST]), FEWEST, 400)),
    )
    found = []
    for s in strokes:
        inside = np.flatnonzero(rows.stroke == s)
        x = rows.readings.displacement[inside]
        # Next to a turn the crosshead hardly moves, and its friction is nobody's model.
        away = np.abs(x - 0.5 * (x.min() + x.max())) < 0.5 * AWAY * np.ptp(x)
        inside, x = inside[away], x[away]
        order = np.argsort(x)
        left = residual[inside] - Polynomial.fit(x, residual[inside], DEGREE)(x)
        found.append(np.interp(grid, x[order], left[order]))
    return np.array(found)


def _shared(profiles: Array) -> Array:
    """Mean square of the mean profile of (..., strokes, grid), N²."""
    return np.asarray(np.mean(profiles.mean(axis=-2) ** 2, axis=-1))
