"""Where pulling begins: a pressure at which the muscle was clearly seen to pull had work to do it with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.specimen.recording import BlockedForce, ForceMap, Loops, Specimen
from mpam_calib.specimen.summary import noise_within

Array = NDArray[np.float64]

PULL_SHARE = 0.02
"""A muscle that shows this share of its greatest force pulls; a gauge that shows less of the top is at 0."""
CLEAR = 5.0
"""Standard deviations of a reading's noise that a clear pull exceeds."""
SCATTER = 1.4826
"""Standard deviation of normal noise in its median size."""


def pulls_at(specimen: Specimen) -> float:
    """The lowest pressure (Pa) with a clear pull; the top level where nothing pulls."""
    top = float(specimen.levels_Pa[-1]) if len(specimen.levels_Pa) else 0.0
    loops, grid, blocked = specimen.loops, specimen.force_map, specimen.blocked_force
    parts = [p for p in (loops, grid, blocked) if p is not None]
    if not parts:
        return top
    force = np.concatenate([part.force_N for part in parts])
    pressure = np.concatenate([part.pressure_Pa for part in parts])
    # A bladder that is longer than at rest pulls by itself: what it pulls says nothing of the pressure.
    way = [] if loops is None else [loops.displacement_m]
    way += [] if grid is None else [grid.contraction]
    way += [] if blocked is None else [np.zeros(len(blocked.force_N))]
    least = PULL_SHARE * float(force.max())
    noise = specimen.sensors.force_sd_N
    if noise is None:
        noise = _loops_noise(loops, least) if loops is not None else _static_noise(grid, blocked, least)
    clear = force > max(least, CLEAR * noise)
    clear &= (np.concatenate(way) >= 0.0) & (pressure > PULL_SHARE * top)
    # One stray reading must not decide: the first percentile of the pulling pressures.
    return float(np.quantile(pressure[clear], 0.01)) if clear.any() else top


def _loops_noise(loops: Loops, least: float) -> float:
    """Noise (N) of neighbours in the strokes that may pull: those at a floor may be held; 0 where unknown."""
    may = loops.force_N > least
    return float(np.nan_to_num(noise_within(loops.force_N[may], loops.stroke[may])))


def _static_noise(grid: ForceMap | None, blocked: BlockedForce | None, least: float) -> float:
    """Noise (N) of static readings that may pull; 0 where unknown.

    What a curve bends between three readings counts as noise: a pull is rather missed than made up. A map is
    looked at along both of its ways, one of which may bend less.
    """
    along: list[Array] = []
    across: list[Array] = []
    if grid is not None:
        may = grid.force_N > least
        force, place, pressure = grid.force_N[may], grid.contraction[may], grid.pressure_Pa[may]
        branch = grid.branch[may]
        along.append(_kinks(force, place, 5 * grid.level[may] + branch))
        same = np.unique(np.round(place, 3), return_inverse=True)[1]
        across.append(_kinks(force, pressure, 5 * same + branch))
    if blocked is not None:
        may = blocked.force_N > least
        kinks = _kinks(
            blocked.force_N[may], blocked.pressure_Pa[may], np.zeros(int(may.sum()), dtype=np.int64)
        )
        along.append(kinks)
        across.append(kinks)
    found = [SCATTER * float(np.median(k)) for k in map(np.concatenate, (along, across)) if len(k)]
    return min(found, default=0.0)


def _kinks(force: Array, place: Array, group: NDArray[np.int64]) -> Array:
    """How far readings (n,) of one curve each lie off the straight line between their neighbours.

    Over what noise of size 1 would make of it.
    """
    order = np.lexsort((place, group))
    force, place, group = force[order], place[order], group[order]
    inside = (group[2:] == group[1:-1]) & (group[1:-1] == group[:-2])
    way = place[2:] - place[:-2]
    share = np.where(way > 0.0, (place[1:-1] - place[:-2]) / np.where(way > 0.0, way, 1.0), 0.5)
    off = force[1:-1] - (1.0 - share) * force[:-2] - share * force[2:]
    return np.asarray(np.abs(off / np.sqrt(1.0 + (1.0 - share) ** 2 + share**2))[inside])
