"""Tests of structure: do the residuals of a fit depend on anything they should not depend on?

For each thing that a row is known by (contraction, pressure, branch, time, cycle, speed) the whitened
residuals are projected on a few smooth functions of it, after what the fit's own parameters could take up.
Without structure the sum of squares there is χ², so the p-value is calibrated as far as the noise is known.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray
from scipy import linalg, stats

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.predicted import linearise
from mpam_calib.criticism.searching.candidates import SPEEDS_APART
from mpam_calib.model.readings import Readings

Array = NDArray[np.float64]

DEGREE = 5
RANK_TOLERANCE = 1e-6
NEED_CLOCK = ("time", "time at the level", "cycle", "speed")


@dataclass(frozen=True)
class Structure:
    """One test: what the residuals were held against, p-value, and the structure's root mean square (N)."""

    against: str
    p_value: float
    size: float


def _smooth(x: Array, degree: int = DEGREE) -> Array:
    """Legendre polynomials of degree 1 to ``degree`` over the range of x, (n, degree)."""
    span = float(np.ptp(x))
    if span <= 0.0:
        return np.empty((len(x), 0))
    return np.asarray(legendre.legvander(2.0 * (x - x.min()) / span - 1.0, degree)[:, 1:])


def _groups(labels: NDArray[Any]) -> Array:
    """Indicator columns of all groups but the first, (n, groups − 1)."""
    return np.asarray((labels[:, None] == np.unique(labels)[1:]).astype(np.float64))


def _along_speed(speed: Array, sign: Array) -> Array:
    """Functions of the logarithm of the speed (n, 3), one of them of either sign by the branch.

    About the usual speed, which rows at rest are given: a difference between the branches alone is none of
    the speed's. None where all rows have one speed.
    """
    moving = speed > 0.0
    log = np.log(speed[moving])
    if not len(log) or np.ptp(log) < np.log(SPEEDS_APART):
        return np.empty((len(speed), 0))
    about = np.zeros(len(speed))
    about[moving] = log - log.mean()
    return np.column_stack([_smooth(about, 2), sign * about])


AGAINST: dict[str, Callable[[Readings], Array]] = {
    "contraction": lambda r: _smooth(r.displacement),
    "pressure": lambda r: _groups(r.level),
    "branch": lambda r: r.sign[:, None] * np.column_stack([np.ones(len(r)), _smooth(r.displacement, 3)]),
    "time": lambda r: _smooth(r.time),
    "time at the level": lambda r: _smooth(np.log1p(r.time_at_level)),
    "cycle": lambda r: _groups(r.cycle),
    "speed": lambda r: _along_speed(r.speed, r.sign),
}


def structure_tests(problem: Problem, fitted: Fit) -> list[Structure]:
    """All tests that the rows allow, in the order of AGAINST."""
    root = np.asarray(linalg.cholesky(problem.noise, lower=True))

    def white(x: Array) -> Array:
        return np.asarray(linalg.solve_triangular(root, x, lower=True))

    taken = _basis(white(linearise(problem, fitted)[1]))
    residual = white(problem.force - fitted.force - fitted.doubt)
    residual = residual - taken @ (taken.T @ residual)
    # Points without a loop have no level among their readings.
    readings = replace(problem.middle(), level=problem.level)
    found = []
    for name, columns in AGAINST.items():
        if name in NEED_CLOCK and not problem.has_clock:
            continue
        seen = white(columns(readings))
        basis = _basis(seen - taken @ (taken.T @ seen))
        if basis.shape[1] == 0:
            continue
        along = basis.T @ residual
        size = float(np.sqrt(np.mean((root @ (basis @ along)) ** 2)))
        found.append(Structure(name, float(stats.chi2.sf(along @ along, basis.shape[1])), size))
    return found


def _basis(columns: Array) -> Array:
    """Orthonormal columns that span the given ones, (n, rank)."""
    norms = np.linalg.norm(columns, axis=0)
    columns = columns[:, norms > 0.0] / norms[norms > 0.0]
    if columns.shape[1] == 0:
        return np.zeros((len(columns), 0))
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return np.asarray(left[:, singular > RANK_TOLERANCE * singular[0]])
