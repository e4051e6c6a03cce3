"""Readings without a clock: force maps, blocked forces, free contractions, as one set of points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings
from mpam_calib.posterior.likelihood.floor import lifted_by_noise
from mpam_calib.specimen.recording import FreeContraction, Specimen

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Points:
    """Points (n,): ``force`` in N; ``censored`` where only "at or below the floor" is known, also those that
    noise lifts above it. The floor of a free contraction of 0 is a force of 0.

    ``kind`` is 0 for a force map, 1 for a blocked force, 2 for a free contraction (a force of zero
    at a measured contraction, whose own noise enters through the curve's slope).
    """

    readings: Readings
    force: Array
    censored: NDArray[np.bool_]
    kind: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.force)

    def level(self, levels: Array) -> NDArray[np.int64]:
        """The level (n,) of each point: its own, or of those (Pa) the nearest."""
        nearest = np.abs(self.readings.pressure[:, None] - levels).argmin(axis=1)
        return np.where(self.readings.level >= 0, self.readings.level, nearest)

    def take(self, rows: NDArray[np.bool_]) -> Points:
        """Some of the points."""
        return Points(self.readings.take(rows), self.force[rows], self.censored[rows], self.kind[rows])


KINDS = ("force_map", "blocked_force", "free_contraction")
FREE = KINDS.index("free_contraction")


def gather_points(specimen: Specimen) -> Points | None:
    """All points of a specimen, or None."""
    if specimen.geometry is None:
        return None
    L0, sensors = specimen.geometry.L0, specimen.sensors
    floor, sd = sensors.force_floor_N, sensors.force_sd_N
    readings: list[Readings] = []
    force: list[Array] = []
    censored: list[NDArray[np.bool_]] = []
    kind: list[NDArray[np.int64]] = []

    def add(rows: Readings, value: Array, slack: NDArray[np.bool_], which: int) -> None:
        readings.append(rows)
        force.append(value)
        censored.append(slack)
        kind.append(np.full(len(value), which))

    if (grid := specimen.force_map) is not None:
        curve = np.unique(np.stack([grid.level, grid.branch]), axis=1, return_inverse=True)[1].ravel()
        lifted = lifted_by_noise(grid.force_N, grid.contraction, curve, grid.censored, floor, sd)
        add(Readings.of_map(grid, L0), grid.force_N, grid.censored | lifted, 0)
    if (blocked := specimen.blocked_force) is not None:
        rows = Readings.at_rest(blocked.pressure_Pa, np.zeros_like(blocked.pressure_Pa))
        one = np.zeros(len(blocked.force_N), dtype=np.int64)
        lifted = lifted_by_noise(blocked.force_N, -blocked.pressure_Pa, one, blocked.censored, floor, sd)
        add(rows, blocked.force_N, blocked.censored | lifted, 1)
    if (free := specimen.free_contraction) is not None:
        rows = Readings.at_rest(free.pressure_Pa, free.contraction * L0)
        add(rows, np.zeros_like(free.contraction), _without_way(free), FREE)
    if not readings:
        return None
    return Points(
        Readings.join(readings), np.concatenate(force), np.concatenate(censored), np.concatenate(kind)
    )


def _without_way(free: FreeContraction) -> NDArray[np.bool_]:
    """Free contractions (n,) of a muscle that does not contract: at 0 its force is none, or pushes.

    Also those that only noise lifts above 0, at pressures below any that clearly contracts it.
    """
    flagged = free.contraction <= 0.0
    one = np.zeros(len(flagged), dtype=np.int64)
    return flagged | lifted_by_noise(free.contraction, -free.pressure_Pa, one, flagged, 0.0)


def floor_of(declared: float | None, points: Points | None) -> float:
    """The floor (N) of slack readings: where none is declared what they read, at least nothing."""
    if declared is not None:
        return declared
    slack = None if points is None else points.censored & (points.kind != FREE)
    if points is None or slack is None or not slack.any():
        return 0.0
    return max(float(np.median(points.force[slack])), 0.0)
