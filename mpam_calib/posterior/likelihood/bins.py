"""Loops reduced before sampling: bins along each stroke, and the scatter inside them.

A stroke of thousands of readings becomes at most :data:`BINS` bins. The force of a bin is the mean of
the model's force at two Gauss points (mean displacement ± its spread), exact to third order in the
bin's width. What the bins lose, the fast scatter inside them, knows only the sensor's noise and is
kept as one scatter matrix; so the sampler's cost does not depend on the number of readings.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings
from mpam_calib.posterior.likelihood.floor import beyond_floor
from mpam_calib.posterior.likelihood.row_motion import rows_and_rest
from mpam_calib.posterior.likelihood.white import Nodes
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

BINS = 32
SHARED = 22
"""Bins of strokes that repeat each other: as many as one stroke's nodes have."""
FINE = np.array([0.25, 0.5, 0.75, 1.0, 1.5, 2.0])
"""The first bins of a stroke are divided further: friction turns over there."""
UNREDUCED = 16
"""Strokes of up to so many readings are left as they are."""
CHUNK = 32
"""At most so many consecutive readings of a bin tell of the fast noise."""
REST_BINS = 0.2
"""Bins of a stroke's rest, at most, for each one of its motion."""
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
    rows at rest. ``scatter`` is
    (Σ c cᵀ over chunks, their number, the contrast matrix Q, dt) of the detrended fast residuals, or None,
    ``chunks`` each chunk's residuals c (chunks, dof) and its bin (chunks,);
    ``nodes`` are what white noise alone needs.
    """

    readings: Readings
    force: Array
    count: Array
    segment: Ints
    position: Ints
    start: Array
    stop: Array
    dt: Array
    slack: NDArray[np.bool_]
    rest: Array
    contraction_scale: float
    scatter: tuple[Array, int, Array, float] | None
    chunks: tuple[Array, Ints] | None
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


def _edges(rest: NDArray[np.bool_], most: int, finest: int) -> Ints:
    """First rows of the bins of a stroke: about ``most``, with finer first ones of ``finest`` rows or more.

    Rows (n,) at rest count less: however long a stroke dwells, its motion keeps most of the bins.
    """
    n = len(rest)
    moving = n - int(rest.sum())
    weight = np.where(rest & (moving > 0), min(1.0, REST_BINS * moving / max(n - moving, 1)), 1.0)
    rows = float(weight.sum())
    bins = int(np.ceil(rows)) if rows <= min(UNREDUCED, most) else min(most, max(UNREDUCED, int(rows) // 4))
    fractions = np.arange(bins, dtype=np.float64)
    if rows >= 4 * finest * bins:
        fractions = np.concatenate([[0.0], FINE, fractions[3:]])
    passed = np.concatenate([[0.0], np.cumsum(weight)])
    edges = np.round(np.interp(fractions / bins * rows, passed, np.arange(n + 1)))
    # Motion and the rests at a stroke's ends share no bin: their friction is another.
    ends = np.flatnonzero(~rest)[[0, -1]] + [0, 1] if moving else np.zeros(0)
    return np.unique(np.concatenate([edges, ends[ends < n]])).astype(np.int64)


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
    stroke_starts, lengths = loops.strokes
    beyond = beyond_floor(loops)
    per_stroke = [
        np.union1d(_edges(part, most, finest), np.flatnonzero(np.diff(slack, prepend=slack[0])))
        for part, slack in zip(
            np.split(rest, stroke_starts[1:]), np.split(beyond, stroke_starts[1:]), strict=True
        )
    ]
    starts = np.concatenate([s + e for s, e in zip(stroke_starts, per_stroke, strict=True)])
    segment = np.repeat(np.arange(len(lengths)), [len(e) for e in per_stroke])
    position = np.concatenate([np.arange(len(e)) for e in per_stroke])
    stops = np.append(starts[1:], len(loops.force_N))
    count = (stops - starts).astype(np.float64)

    def mean(x: Array) -> Array:
        return np.asarray(np.add.reduceat(x, starts) / count)

    displacement = mean(loops.displacement_m)
    row_bin = np.repeat(np.arange(len(starts)), stops - starts)
    spread = np.sqrt(mean((loops.displacement_m - displacement[row_bin]) ** 2))
    direction = np.where(loops.branch[starts] == -1, 1.0, -1.0)
    # A bin that comes to rest has the speed of its moving part.
    weight = np.where(rest, 1e-9, 1.0)

    def moving_mean(x: Array) -> Array:
        return np.asarray(np.add.reduceat(weight * x, starts) / np.add.reduceat(weight, starts))

    travel = mean(rows.travel)
    force = mean(loops.force_N)
    common = {
        "pressure": mean(loops.pressure_Pa),
        "sign": np.where(np.abs(loops.branch[starts]) == 1, loops.branch[starts], 0).astype(np.float64),
        "level": loops.level[starts],
        "time": mean(loops.time_s),
        "file_time": mean(loops.time_s - loops.began_s),
        "time_at_level": mean(rows.time_at_level),
        "cycle": loops.cycle[starts].astype(np.float64),
        "test_cycle": rows.test_cycle[starts],
        "pace": rows.pace[starts],
        "reversal": rows.reversal[starts],
        "strokes_before": rows.strokes_before[starts],
        "speed": np.exp(moving_mean(np.log(np.maximum(rows.speed, 1e-12)))),
    }
    common["relaxed"] = np.add.reduceat(rows.relaxed, starts) / count[:, None]
    behind = mean(rows.behind)
    # What is stretched for the first time is so at both points.
    apart = np.where(behind < spread, 0.0, direction * spread)
    halves = [
        Readings(
            displacement=displacement + side * direction * spread,
            travel=np.maximum(travel + side * spread, 0.0),
            behind=np.maximum(behind - side * apart, 0.0),
            **common,
        )
        for side in (-1.0, 1.0)
    ]
    ends = stroke_starts + lengths - 1
    # Strokes of one reading take no time.
    dt = np.maximum((loops.time_s[ends] - loops.time_s[stroke_starts]) / np.maximum(lengths - 1, 1), 1e-9)
    strokes = np.repeat(np.arange(len(lengths)), lengths)
    repeated = None if memory else Nodes.of_repeated(loops.force_N, rows, strokes, SHARED)
    scatter, chunks = _scatter(loops, starts, stops, segment, position, dt)
    return LoopBins(
        readings=Readings.join(halves),
        force=force,
        count=count,
        segment=segment,
        position=position,
        start=loops.time_s[starts],
        stop=loops.time_s[stops - 1],
        dt=dt,
        slack=_beyond_slack(
            (mean(loops.censored.astype(np.float64)) >= SLACK_SHARE) | beyond[starts],
            displacement,
            segment,
            2 * loops.level[starts] + (direction > 0),
        ),
        rest=mean(rest.astype(np.float64)),
        contraction_scale=float(np.ptp(displacement)) or 1.0,
        scatter=scatter,
        chunks=chunks,
        averaged=loops.averaged,
        nodes=repeated or Nodes.build(loops.force_N, rows, _wider(starts, segment, position, most)),
    )


def _beyond_slack(
    slack: NDArray[np.bool_], displacement: Array, segment: Ints, group: Ints
) -> NDArray[np.bool_]:
    """Slack bins, and those of the same level and branch that are contracted further.

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


def _wider(starts: Ints, segment: Ints, position: Ints, most: int) -> Ints:
    """First rows of bins of twice the width, where a stroke has all its bins: a parabola fits them too."""
    full = np.bincount(segment)[segment] > most
    kept = ~full | (position <= len(FINE)) | ((position - len(FINE)) % 2 == 1)
    return np.asarray(starts[kept])


def _scatter(
    loops: Loops, starts: Ints, stops: Ints, segment: Ints, position: Ints, dt: Array
) -> tuple[tuple[Array, int, Array, float], tuple[Array, Ints]] | tuple[None, None]:
    """Scatter matrix of detrended chunks of consecutive rows, one chunk from each regular bin; and these."""
    typical = float(np.median(dt))
    rows = stops - starts
    last = np.append(segment[1:] != segment[:-1], True)
    # Bins next to a turn are left out: there the force itself is fast.
    usable = (position >= len(FINE) + 1) & ~last & (np.abs(dt[segment] / typical - 1.0) < 0.1)
    censored = np.add.reduceat(loops.censored.astype(np.float64), starts) > 0
    usable &= (rows >= 4) & ~censored
    if usable.sum() < 8:
        return None, None
    size = int(min(CHUNK, np.quantile(rows[usable], 0.1)))
    if size < 4:
        return None, None
    usable &= rows >= size
    chunks = loops.force_N[starts[usable][:, None] + np.arange(size)]
    # A parabola, however short the chunk: a slope alone would leave the force's own bend in the noise.
    basis = np.vander(np.linspace(-1.0, 1.0, size), 3)
    full, _ = np.linalg.qr(basis, mode="complete")
    contrast = full[:, 3:]
    projected = chunks @ contrast
    pooled = projected.T @ projected, int(usable.sum()), contrast, typical
    return pooled, (projected, np.flatnonzero(usable))
