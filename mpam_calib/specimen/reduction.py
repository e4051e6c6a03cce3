"""Averaging the rows of a very large recording while it is read."""

from __future__ import annotations

import numpy as np
import pandas as pd

from mpam_calib.specimen.levels import SMALLEST_GAP_PA, STATIC_GAPS, STEADY
from mpam_calib.specimen.motion import noise_sd, read_motion, turn_threshold
from mpam_calib.specimen.plausibility import MOST, lone_nines
from mpam_calib.specimen.recording import Bools, Floats
from mpam_calib.units import KPA

ROWS_KEPT = 250_000
"""Loops of more rows than about this are averaged: 100 Hz for 40 minutes are kept as they are."""

JUMP_SDS = 12.0
"""A step is a jump if it is larger than so many standard deviations of the noise."""

_SETPOINT = "setpoint_kPa"
_LABELS = ("cycle", "branch")


def rows_per_mean(rows: float) -> int:
    """How many consecutive rows to average so that about ``ROWS_KEPT`` remain."""
    return max(1, int(np.ceil(rows / ROWS_KEPT)))


def average_rows(frame: pd.DataFrame, rows: int, censored: Bools) -> tuple[pd.DataFrame, Bools]:
    """Means of ``rows`` consecutive rows of a block, and whether at least half of each is censored.

    A group never spans a change of setpoint, cycle or branch, a turn of the crosshead, a gap
    in time or a step of the pressure; its index is the editor's number of its first row.
    """
    labels = [name for name in _LABELS if name in frame]
    if _SETPOINT in frame and _dwells(frame[_SETPOINT].to_numpy(), rows):
        labels.append(_SETPOINT)
    cuts = _cuts(frame, labels)
    run_start = np.flatnonzero(cuts)
    run = np.cumsum(cuts) - 1
    within = np.arange(len(frame)) - run_start[run]
    length = np.diff(np.append(run_start, len(frame)))
    # Equal groups inside each run, rather than full ones and a small remainder.
    groups = np.maximum(1, np.round(length / rows)).astype(np.int64)
    part = within * groups[run] // length[run]
    starts = np.flatnonzero(cuts | (np.diff(part, prepend=0) != 0))
    sizes = np.diff(np.append(starts, len(frame)))
    measured = frame.drop(columns=labels).astype(float)
    means = measured.groupby(np.repeat(np.arange(len(starts)), sizes)).mean()  # empty cells do not count
    means.index = frame.index[starts]
    share = np.add.reduceat(censored.astype(float), starts) / sizes
    return means.assign(**{name: frame[name].to_numpy()[starts] for name in labels}), share >= 0.5


def _dwells(setpoint: Floats, rows: int) -> bool:
    """Whether a setpoint stays long beside so many rows; the noise of one read back is averaged instead."""
    return len(setpoint) >= STEADY * rows * int(np.count_nonzero(np.diff(setpoint)))


def _cuts(frame: pd.DataFrame, labels: list[str]) -> Bools:
    """Whether a group must begin at each row."""
    cuts = np.zeros(len(frame), dtype=bool)
    cuts[0] = True
    for name in MOST.keys() & frame.columns:
        codes, _ = lone_nines(frame[name].to_numpy())  # a mean would hide them
        cuts[codes] = True
        cuts[np.minimum(codes + 1, len(cuts) - 1)] = True
    for name in labels:
        cuts[1:] |= np.diff(frame[name].to_numpy()) != 0
    if _SETPOINT in frame:
        setpoint = frame[_SETPOINT].to_numpy()
        gap = max(SMALLEST_GAP_PA / KPA, STATIC_GAPS[0] * float(np.abs(setpoint).max()))
        cuts[1:] |= np.abs(np.diff(setpoint)) > max(gap, JUMP_SDS * noise_sd(setpoint))
    time = np.diff(frame["time_s"].to_numpy())
    cuts[1:] |= time > 5.0 * np.median(time) if len(time) else False
    cuts[1:] |= _steps(frame["pressure_kPa"].to_numpy())
    displacement = frame["displacement_mm"].to_numpy()
    cuts[1:] |= _steps(displacement)
    branch = read_motion(displacement, turn_threshold(displacement), noise_sd(displacement)).branch
    cuts[1:] |= np.diff(branch) != 0
    return cuts


def _steps(values: Floats) -> Bools:
    """Whether each step between rows is a jump: far above the noise and a visible part of the range."""
    step = np.abs(np.diff(values))
    jump: Bools = step > max(JUMP_SDS * noise_sd(values), 0.03 * float(np.ptp(values)))
    return jump
