"""The noise of a force map's readings, told by themselves: what no smooth curve along the contraction has.

Each branch of each level is a curve of its own, a Gaussian process about a parabola; how large and how fast
they change, and the noise, are alike in all of them.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg, optimize

from mpam_calib.model.noise import white_noise_prior
from mpam_calib.posterior.likelihood.points import Points

Array = NDArray[np.float64]

FEWEST = 4
"""Readings of a curve that tell more than its parabola."""
LEAST_SPARE = 8
"""Readings, beyond the curves' parabolas, from which on the noise is told by them."""
SIZE, SIZE_SD = 0.1, 2.0
"""Prior of the curves' departure from a parabola: its median as a share of the force scale, log sd."""
LENGTH, LENGTH_SD = 0.5, 0.5
"""Prior of the length along which they change, as a share of the largest contraction."""
CURVES, READINGS = 24, 60
"""At most so many curves, and readings of each, are looked at."""
MOST = 5.0
"""Prior sds within which all three are looked for."""
TINY = 1e-9
"""Share of the curves' own variance that keeps the covariance positive."""


class _Curve(NamedTuple):
    """One curve, its parabola taken out: distances (n, n), and forces (m,) seen through contrasts (n, m)."""

    distance: Array
    contrast: Array
    seen: Array


def static_noise(points: Points, level: NDArray[np.int64], force_scale: float) -> float | None:
    """Sd (N) of one reading of a force map, under calibration's prior; None where too few tell it.

    ``level`` (n,) numbers the points' pressures.
    """
    curves = _curves(points, level)
    if sum(len(curve.seen) for curve in curves) < LEAST_SPARE:
        return None
    prior = white_noise_prior(None, force_scale)

    def badness(z: Array) -> float:
        noise, size = float(prior.from_normal(z[0])), SIZE * force_scale * np.exp(SIZE_SD * z[1])
        length = LENGTH * np.exp(LENGTH_SD * z[2])
        return 0.5 * float(z @ z) - sum(_log_likelihood(curve, noise, size, length) for curve in curves)

    # From little noise and from much: a noisy curve and a ragged one are two explanations.
    starts = (np.array([shift, 0.0, 0.0]) for shift in (-1.5, 0.0, 1.5))
    found = [
        optimize.minimize(badness, start, method="L-BFGS-B", bounds=[(-MOST, MOST)] * 3) for start in starts
    ]
    best = min(found, key=lambda result: float(result.fun))
    return float(prior.from_normal(best.x[0]))


def _curves(points: Points, level: NDArray[np.int64]) -> list[_Curve]:
    rows = np.flatnonzero((points.kind == 0) & ~points.censored)
    if not len(rows):
        return []
    rows = rows[np.argsort(points.readings.displacement[rows], kind="stable")]
    sides = np.stack([level[rows], points.readings.sign[rows].astype(np.int64)])
    curve = np.unique(sides, axis=1, return_inverse=True)[1].ravel()
    longest = max(float(np.ptp(points.readings.displacement[rows])), 1e-12)
    found = []
    for number in _spread(curve.max() + 1, CURVES):
        here = rows[curve == number]
        here = here[_spread(len(here), READINGS)]
        x = points.readings.displacement[here] / longest
        columns = np.vander(x, 3)
        P = points.readings.pressure[here]
        if np.ptp(P) > 0.0:
            # The pressure is never quite its level's, and the force follows it.
            columns = np.hstack([columns, (P - P.mean())[:, None] / np.ptp(P)])
        if len(here) >= FEWEST:
            contrast = linalg.null_space(columns.T)
            found.append(_Curve(np.abs(x[:, None] - x), contrast, contrast.T @ points.force[here]))
    return found


def _spread(count: int, most: int) -> NDArray[np.int64]:
    """Numbers below ``count``: all, or as many as ``most`` of them, evenly."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def _log_likelihood(curve: _Curve, noise: float, size: float, length: float) -> float:
    kernel = size**2 * np.exp(-0.5 * (curve.distance / length) ** 2)
    diagonal = noise**2 + TINY * size**2
    covariance = curve.contrast.T @ kernel @ curve.contrast + diagonal * np.eye(len(curve.seen))
    root = linalg.cholesky(covariance, lower=True)
    z = linalg.solve_triangular(root, curve.seen, lower=True)
    return -0.5 * float(z @ z) - float(np.log(np.diagonal(root)).sum())
