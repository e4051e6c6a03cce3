"""A tensile test of any length as at most some hundred points, and what its rows scatter about them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.likeness import autocorrelation_time, hidden_time
from mpam_calib.specimen.recording import Tensile

Array = NDArray[np.float64]

TENSILE_POINTS = 400
"""Rows that are taken as they are; more are grouped, two points a group."""
DEGREE, ROWS_EACH = 12, 2
"""Of the polynomial whose residuals show how alike neighbouring rows are, as high as a remainder goes; and
rows for each degree."""
QUIET = 1e-4
"""Share of the stress below which nothing but rounding, or a curve that was computed, is left of it."""
FEWEST = 6
"""Readings that a test is worth at least, however alike its rows are."""


@dataclass(frozen=True)
class TensilePoints:
    """Stress-strain points (n,) in the declared range: strain, stress (Pa), readings behind each.

    ``within`` (Pa²) is the sum of squares of the rows about the lines of their groups, ``rows`` how many
    independent readings all of them are worth.
    """

    strain: Array
    stress: Array
    count: Array
    within: float
    rows: float


def gather_tensile(tensile: Tensile, low: float, high: float) -> TensilePoints:
    """The test's points within [low, high] in order of strain, groups of neighbours where there are many.

    A group keeps its line, as two points at the mean strain ± its spread that weigh half of its rows each,
    and the sum of squares about that line. Together they are the sum of squares of all rows about any law
    that is straight across the group: what differs at one strain (noise, another piece, the way back) is not
    averaged away.
    """
    inside = (tensile.strain >= low) & (tensile.strain <= high)
    strain, stress = tensile.strain[inside], tensile.stress_Pa[inside]
    order = np.argsort(strain, kind="stable")
    n = len(order)
    e, s = strain[order], stress[order]
    points = TensilePoints(e, s, np.ones(n), 0.0, float(n)) if n <= TENSILE_POINTS else _grouped(e, s)
    return _counted(points, _alike(points, strain, stress))


def _grouped(e: Array, s: Array) -> TensilePoints:
    """Rows (N,) in order of strain as the lines of groups of neighbours."""
    n = len(e)
    starts = np.linspace(0, n, TENSILE_POINTS // 2 + 1).astype(np.int64)[:-1]
    size = np.diff(np.append(starts, n))
    own = np.repeat(np.arange(len(starts)), size)

    def mean(z: Array) -> Array:
        return np.asarray(np.add.reduceat(z, starts) / size)

    middle, level = mean(e), mean(s)
    e, s = e - middle[own], s - level[own]
    spread = np.sqrt(mean(e**2))
    e = e / np.where(spread > 0.0, spread, 1.0)[own]
    rise = mean(e * s)
    ends = np.array([-1.0, 1.0])
    return TensilePoints(
        (middle[:, None] + ends * spread[:, None]).ravel(),
        (level[:, None] + ends * rise[:, None]).ravel(),
        np.repeat(0.5 * size, 2),
        float(np.sum((s - rise[own] * e) ** 2)),
        float(n),
    )


def _counted(points: TensilePoints, alike: float) -> TensilePoints:
    """The points where each row says as much as one in ``alike``.

    Pieces that differ, a way back, and a load cell whose noise is slow leave residuals that go on from row to
    row: more rows of the same pieces then tell no more of the law, though each scatters as before.
    """
    rows = min(max(points.rows / alike, FEWEST), points.rows)
    share = rows / points.rows if rows else 1.0
    return TensilePoints(points.strain, points.stress, share * points.count, share * points.within, rows)


def _alike(points: TensilePoints, strain: Array, stress: Array) -> float:
    """Integrated autocorrelation time, at least 1, of the rows (N,) in their order, about a smooth curve."""
    if (degree := min(DEGREE, len(strain) // ROWS_EACH)) < 1:
        return 1.0
    centre, half = 0.5 * float(strain.max() + strain.min()), 0.5 * float(np.ptp(strain)) or 1.0
    weight = np.sqrt(points.count)
    waves = np.polynomial.chebyshev.chebvander((points.strain - centre) / half, degree)
    curve = np.linalg.lstsq(weight[:, None] * waves, weight * points.stress, rcond=None)[0]
    left = stress - np.polynomial.chebyshev.chebval((strain - centre) / half, curve)
    if np.sum(left**2) <= QUIET**2 * np.sum(stress**2):
        return 1.0
    return max(autocorrelation_time(left), hidden_time(left, degree))
