"""What a specimen holds, in numbers a person can check against the rig's log book."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpam_calib.specimen.motion import run_starts
from mpam_calib.specimen.recording import BRANCH_WORDS, Floats, Ints, Loops
from mpam_calib.units import KPA, MINUTE, MM

SPEED_SHARE = 0.1
"""Speeds closer than this are one speed."""
EQUAL = 1e-9
"""Forces that differ by less than this share of the largest are equal."""
BRANCH_NAMES = {code: word or "none" for word, code in BRANCH_WORDS.items()}
"""What a branch code is called."""


@dataclass(frozen=True)
class LevelSummary:
    """One pressure level of the loops (lab units; the contraction's range and the force's)."""

    pressure_kPa: float
    pressure_sd_kPa: float
    rows: int
    cycles: int
    branches: tuple[str, ...]
    speeds_mm_per_min: tuple[float, ...]
    contraction: tuple[float, float]
    force_N: tuple[float, float]


@dataclass(frozen=True)
class LoopsSummary:
    """All levels, the sampling rate of each clock (Hz) and the estimated white force noise (N)."""

    levels: tuple[LevelSummary, ...]
    sampling_Hz: tuple[float, ...]
    noise_N: float


def summarise_loops(loops: Loops, levels_Pa: Floats, L0: float) -> LoopsSummary:
    """Figures of the loops for :func:`mpam_calib.cli.check.check`; ``L0`` in m."""
    starts = run_starts(loops.stroke)
    speeds = stroke_speeds(loops) * MINUTE / MM
    levels = []
    for index, pressure in enumerate(levels_Pa):
        rows = loops.level == index
        if not rows.any():
            continue
        here = loops.level[starts] == index
        contraction, force = loops.displacement_m[rows] / L0, loops.force_N[rows]
        levels.append(
            LevelSummary(
                pressure_kPa=pressure / KPA,
                pressure_sd_kPa=float(loops.pressure_Pa[rows].std()) / KPA,
                rows=int(rows.sum()) * loops.averaged,
                cycles=len(np.unique(loops.cycle[rows])),
                branches=tuple(BRANCH_NAMES[int(code)] for code in np.unique(loops.branch[rows])[::-1]),
                speeds_mm_per_min=distinct(speeds[here & (np.abs(loops.branch[starts]) == 1)]),
                contraction=(float(contraction.min()), float(contraction.max())),
                force_N=(float(force.min()), float(force.max())),
            )
        )
    return LoopsSummary(tuple(levels), sampling_rates(loops), force_noise(loops))


def stroke_speeds(loops: Loops) -> Floats:
    """Speed of every stroke in m/s, shape (strokes,): over the middle half of its travel.

    Where fewer than two readings lie there, between those on either side; 0 where there are none.
    """
    starts = run_starts(loops.stroke)
    speeds = np.zeros(len(starts))
    ends = [*starts[1:], len(loops.stroke)]
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        travel = np.abs(loops.displacement_m[start:end] - loops.displacement_m[start])
        inside = np.flatnonzero((travel > 0.25 * travel.max()) & (travel < 0.75 * travel.max()))
        if len(inside) < 2 and abs(loops.branch[start]) == 1:
            beyond = int(np.argmax(travel >= 0.75 * travel.max()))
            inside = np.array([*np.flatnonzero(travel[:beyond] <= 0.25 * travel.max())[-1:], beyond])
        if len(inside) > 1:
            first, last = start + inside[0], start + inside[-1]
            time = loops.time_s[last] - loops.time_s[first]
            speeds[i] = abs(loops.displacement_m[last] - loops.displacement_m[first]) / time
    return speeds


def distinct(values: Floats) -> tuple[float, ...]:
    """The different ones among ``values`` (above 0), those within 10 % of each other as their median."""
    ordered = np.sort(values[values > 0.0])
    if not len(ordered):
        return ()
    parts = np.split(ordered, np.flatnonzero(np.diff(np.log(ordered)) > SPEED_SHARE) + 1)
    return tuple(float(np.median(part)) for part in parts)


def sampling_rates(loops: Loops) -> tuple[float, ...]:
    """The different sampling rates of the clocks, Hz, before any averaging."""
    rates = []
    for clock in np.unique(loops.clock):
        steps = np.diff(loops.time_s[loops.clock == clock])
        if len(steps):
            rates.append(loops.averaged / float(np.median(steps)))
    return distinct(np.array(rates))


def force_noise(loops: Loops) -> float:
    """White noise of one force reading, N, by strokes; of rows before any averaging where they are known."""
    if loops.averaged > 1 and loops.noise_N > 0.0:
        return loops.noise_N
    return noise_within(loops.force_N, loops.stroke) * math.sqrt(loops.averaged)


def reading_noise(loops: Loops) -> float:
    """:func:`force_noise`, or what the steps of the display make, where that is more; nan where unknown."""
    steps = np.diff(np.unique(loops.force_N))
    steps = steps[steps > EQUAL * np.abs(loops.force_N).max()]
    return max(force_noise(loops), float(steps.min()) / math.sqrt(12.0)) if len(steps) else math.nan


def noise_within(values: Floats, group: Ints) -> float:
    """Sd of white noise (robust) of values (n,) in groups of neighbours (n,).

    From second differences, where slow changes cancel; nan without three values of a group.
    """
    inside = (group[2:] == group[1:-1]) & (group[1:-1] == group[:-2])
    second = np.abs(np.diff(values, n=2))[inside]
    if not len(second):
        return math.nan
    return 1.4826 * float(np.median(second)) / math.sqrt(6.0)  # 1, -2, 1: six variances
