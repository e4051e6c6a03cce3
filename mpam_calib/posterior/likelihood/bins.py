"""Loops reduced before sampling: bins along each stroke, and the scatter inside them.

A stroke of thousands of readings becomes at most :data:`BINS` bins. The force of a bin is the mean of
the model's force at two Gauss points (mean displacement ± its spread), exact to third order in the
bin's width. What the bins lose, the fast scatter inside them, knows only the sensor's noise and is
kept as one scatter matrix; so the sampler's cost does not depend on the number of readings.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings
from mpam_calib.posterior.likelihood.floor import beyond_floor
from mpam_calib.posterior.likelihood.parting import Parting
from mpam_calib.posterior.likelihood.row_motion import rows_and_rest
from mpam_calib.posterior.likelihood.scatter import Chunks, FastScatter, fast_scatter
from mpam_calib.posterior.likelihood.white import Nodes
from mpam_calib.specimen.recording import UNLOADING, Loops

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

BINS = 32
SHARED = 22
"""Bins of strokes that repeat each other: as many as one stroke's nodes have."""
SLACK_SHARE = 0.2
"""A bin with this share of its readings at or below the floor says "slack", not a value."""
SLACK_ABOVE = 4.5
"""Sds of noise above the floor that slack readings stay below."""


@dataclass(frozen=True)
class LoopBins:
    """Bins (n,) in time order, in segments of one stroke each.

    ``readings`` holds the 2n Gauss points (all lower ones, then all upper ones); ``force`` the mean
    reading (N); ``count`` its number of rows; ``segment`` and ``position`` place a bin in the padded
    (segments, width) layout; ``start``, ``stop`` (s) are its first and last row's times and ``dt``
    (segments,) the time between rows; ``slack`` marks bins at the floor, ``rest`` is the share of a bin's
    rows at rest. ``scatter`` and ``chunks`` hold the fast scatter inside the bins, None where it tells
    nothing; ``nodes`` are what white noise alone needs.
    """

    readings: Readings
    force: Array
    count: Array
    segment: Ints
    position: Ints
    start: Array
    stop: Array
    dt: Array
    slack: Bools
    rest: Array
    contraction_scale: float
    scatter: FastScatter | None
    chunks: Chunks | None
    averaged: int
    nodes: Nodes

    def __len__(self) -> int:
        return len(self.force)

    @property
    def segments(self) -> int:
        """Number of strokes."""
        return len(self.dt)

    @property
    def width(self) -> int:
        """Bins of the longest stroke."""
        return int(self.position.max()) + 1

    def middle(self) -> Readings:
        """One reading per bin, at its mean."""
        return self.readings.middles()


def bin_loops(loops: Loops, most: int = BINS, finest: int = 2, memory: bool = True) -> LoopBins:
    """Reduce loops (rows in time order) to about ``most`` bins a stroke.

    Without ``memory`` strokes that repeat each other share their ``nodes``.
    Those at its turn are finer where they keep ``finest`` rows: in bins of one row the encoder's noise may go
    back and forth, and a covariance of such bins is no chain along the way.
    """
    rows, rest = rows_and_rest(loops)
    if loops.unclear is not None:
        # What has no sure branch tells of the motion, and nothing else.
        clear = ~loops.unclear
        rest, rows = rest[clear], rows.take(np.flatnonzero(clear))
        loops = loops.clear
    beyond = beyond_floor(loops)
    parting = Parting.of(loops, rest, beyond, most, finest)
    first, lengths = loops.strokes
    took = loops.time_s[first + lengths - 1] - loops.time_s[first]
    # Strokes of one reading take no time.
    dt = np.maximum(took / np.maximum(lengths - 1, 1), 1e-9)
    scatter, chunks = fast_scatter(loops, parting, dt)
    displacement = parting.mean(loops.displacement_m)
    slack = parting.mean(loops.censored.astype(np.float64)) >= SLACK_SHARE
    outward = loops.branch[parting.starts] == UNLOADING
    return LoopBins(
        readings=_gauss_points(rows, rest, parting),
        force=parting.mean(loops.force_N),
        count=parting.rows.astype(np.float64),
        segment=parting.segment,
        position=parting.position,
        start=loops.time_s[parting.starts],
        stop=loops.time_s[parting.stops - 1],
        dt=dt,
        slack=_beyond_slack(
            slack | beyond[parting.starts],
            displacement,
            parting.segment,
            2 * loops.level[parting.starts] + outward,
        ),
        rest=parting.mean(rest.astype(np.float64)),
        contraction_scale=float(np.ptp(displacement)) or 1.0,
        scatter=scatter,
        chunks=chunks,
        averaged=loops.averaged,
        nodes=_nodes(loops, rows, parting.wider(most), memory),
    )


def _gauss_points(rows: Readings, rest: Bools, parting: Parting) -> Readings:
    """The two places (2n,) of each bin, all lower ones, then all upper ones: its mean ± its spread."""
    first = rows.take(parting.starts)
    displacement, spread = parting.mean(rows.displacement), parting.spread(rows.displacement)
    travel, behind = parting.mean(rows.travel), parting.mean(rows.behind)
    # A bin that comes to rest has the speed of its moving part.
    log_speed = parting.weighted_mean(np.log(np.maximum(rows.speed, 1e-12)), np.where(rest, 1e-9, 1.0))
    middle = replace(
        first,
        pressure=parting.mean(rows.pressure),
        time=parting.mean(rows.time),
        file_time=parting.mean(rows.file_time),
        time_at_level=parting.mean(rows.time_at_level),
        relaxed=parting.mean(rows.relaxed),
        speed=np.exp(log_speed),
    )
    direction = np.where(first.sign == -1, 1.0, -1.0)
    # What is stretched for the first time is so at both points.
    apart = np.where(behind < spread, 0.0, direction * spread)
    halves = [
        replace(
            middle,
            displacement=displacement + side * direction * spread,
            travel=np.maximum(travel + side * spread, 0.0),
            behind=np.maximum(behind - side * apart, 0.0),
        )
        for side in (-1.0, 1.0)
    ]
    return Readings.join(halves)


def _nodes(loops: Loops, rows: Readings, wider: Ints, memory: bool) -> Nodes:
    """Nodes of the strokes that repeat each other, without ``memory``, else of bins from ``wider``'s rows."""
    _, lengths = loops.strokes
    strokes = np.repeat(np.arange(len(lengths)), lengths)
    repeated = None if memory else Nodes.of_repeated(loops.force_N, rows, strokes, SHARED)
    # A parabola fits bins of twice the width, too.
    return repeated or Nodes.build(loops.force_N, rows, wider)


def _beyond_slack(slack: Bools, displacement: Array, segment: Ints, group: Ints) -> Bools:
    """Slack bins, and those of the same level and branch (``group``) that are contracted further.

    Past the floor the readings are its noise, half of it above: a bin of a few readings may show none at the
    floor and is slack all the same. A stroke's slack begins at its first slack bin, a group's at the median.
    """
    if not slack.any():
        return slack
    found = slack.copy()
    for one in np.unique(group[slack]):
        inside = group == one
        first = [
            displacement[slack & inside & (segment == j)].min() for j in np.unique(segment[slack & inside])
        ]
        found |= inside & (displacement >= np.median(first))
    return found
