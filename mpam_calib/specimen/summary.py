"""What a specimen holds, in numbers a person can check against the rig's log book."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mpam_calib.specimen.motion import run_starts
from mpam_calib.specimen.plausibility import longest_contraction
from mpam_calib.specimen.recording import BRANCH_WORDS, Floats, Loops, Specimen
from mpam_calib.units import KPA, MINUTE, MM

GAP_STEPS = 20.0
"""A pause in the recording is this many times longer than the usual step."""
WANDER_SHARE = 0.05
"""Pressure that strays further than this share from its level is worth a remark."""
SPEED_SHARE = 0.1
"""Speeds closer than this are one speed."""
USUAL_SHARE = 0.99
"""Forces and pressures up to this quantile are the usual ones ..."""
FAR = 30.0
"""... and this many times as large is far from them; forces of muscles are within it of the gas's own."""

_BRANCH_NAMES = {code: word or "none" for word, code in BRANCH_WORDS.items()}


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
                branches=tuple(_BRANCH_NAMES[int(code)] for code in np.unique(loops.branch[rows])[::-1]),
                speeds_mm_per_min=distinct(speeds[here & (loops.branch[starts] != 0)]),
                contraction=(float(contraction.min()), float(contraction.max())),
                force_N=(float(force.min()), float(force.max())),
            )
        )
    return LoopsSummary(tuple(levels), sampling_rates(loops), force_noise(loops))


def stroke_speeds(loops: Loops) -> Floats:
    """Speed of every stroke in m/s, shape (strokes,): over the middle half of its travel."""
    starts = run_starts(loops.stroke)
    speeds = np.zeros(len(starts))
    ends = [*starts[1:], len(loops.stroke)]
    for i, (start, end) in enumerate(zip(starts, ends, strict=True)):
        travel = np.abs(loops.displacement_m[start:end] - loops.displacement_m[start])
        inside = np.flatnonzero((travel > 0.25 * travel.max()) & (travel < 0.75 * travel.max()))
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
    """White noise of one force reading, N.

    From second differences within strokes, where slow changes cancel; nan without three rows.
    """
    inside = loops.stroke[2:] == loops.stroke[:-2]
    second = np.abs(np.diff(loops.force_N, n=2))[inside]
    if not len(second):
        return math.nan
    sd = 1.4826 * float(np.median(second)) / math.sqrt(6.0)  # 1, -2, 1: six variances
    return sd * math.sqrt(loops.averaged)


def oddities(specimen: Specimen) -> list[str]:
    """What can be used but should be looked at, one sentence each."""
    remarks = list(specimen.notes)
    loops = specimen.loops
    if loops is not None:
        remarks += _odd_times(loops)
        remarks += _odd_levels(loops, specimen.levels_Pa)
    remarks += _odd_forces(specimen)
    remarks += _odd_contractions(specimen)
    for name, part in (
        ("loops", loops),
        ("force_map", specimen.force_map),
        ("blocked_force", specimen.blocked_force),
    ):
        if part is not None and part.censored.any():
            count = int(part.censored.sum())
            remarks.append(
                f"{name}: {count} of {len(part.censored)} rows are slack (at the floor or censored)"
            )
    return remarks


def _odd_times(loops: Loops) -> list[str]:
    remarks = []
    for clock in np.unique(loops.clock):
        time, level = loops.time_s[loops.clock == clock], loops.level[loops.clock == clock]
        steps = np.diff(time)
        if not len(steps):
            continue
        # A pause between two levels is the protocol's; one within a level is not.
        gaps = np.flatnonzero((steps > GAP_STEPS * np.median(steps)) & (np.diff(level) == 0))
        if len(gaps):
            longest = gaps[np.argmax(steps[gaps])]
            many = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps"
            remarks.append(
                f"loops: {many} in the time of file {clock + 1} within a level, "
                f"the longest {steps[longest]:.3g} s after {time[longest]:.6g} s"
            )
    return remarks


def _odd_levels(loops: Loops, levels_Pa: Floats) -> list[str]:
    remarks = []
    for index in np.unique(loops.level):
        rows = loops.level == index
        name = f"loops: {levels_Pa[index] / KPA:.4g} kPa"
        present = [int(code) for code in np.unique(loops.branch[rows]) if code != 0]
        if len(present) == 1:
            remarks.append(f"{name} has only the branch {_BRANCH_NAMES[present[0]]}")
        held = np.abs(loops.branch[rows]) == 2
        steady = loops.pressure_Pa[rows][~held]
        if len(steady):
            stray = float(np.quantile(np.abs(steady - levels_Pa[index]), 0.99))
            if stray > WANDER_SHARE * abs(levels_Pa[index]):
                remarks.append(f"{name} wanders by {stray / KPA:.3g} kPa")
        idle = int((loops.branch[rows] == 0).sum())
        if idle:
            remarks.append(f"{name} has {idle} rows without a branch (before the first motion)")
    return remarks


def _odd_forces(specimen: Specimen) -> list[str]:
    """Forces far from what the gas can pull, and readings far from all others."""
    if specimen.geometry is None:
        return []
    geometry, remarks = specimen.geometry, []
    # Chou and Hannaford 1996 (doi:10.1109/70.481753) at the initial length; alpha0 from the hoop direction.
    per_pascal = 3.0 * math.tan(geometry.alpha0) ** 2 - 1.0 / math.cos(geometry.alpha0) ** 2
    per_pascal *= math.pi * geometry.R0**2
    for name, part in (
        ("loops", specimen.loops),
        ("force_map", specimen.force_map),
        ("blocked_force", specimen.blocked_force),
    ):
        if part is None:
            continue
        usual = float(np.quantile(np.abs(part.force_N), USUAL_SHARE))
        stray = int((np.abs(part.force_N) > FAR * usual).sum()) if usual > 0.0 else 0
        if stray:
            extreme = part.force_N[np.abs(part.force_N).argmax()]
            many = "a force is" if stray == 1 else f"{stray} forces are"
            remarks.append(f"{name}: {many} far from all others ({extreme:.4g} N)")
        gas = per_pascal * float(np.quantile(part.pressure_Pa, USUAL_SHARE))
        if gas > 0.0 and not gas / FAR < usual < FAR * gas:
            remarks.append(
                f"{name}: forces up to {usual:.3g} N, while the gas alone pulls about {gas:.3g} N at the "
                "highest pressure; are the units of force, pressure and radius right?"
            )
    return remarks


def _odd_contractions(specimen: Specimen) -> list[str]:
    if specimen.geometry is None:
        return []
    geometry = specimen.geometry
    parts: dict[str, Floats] = {}
    if specimen.loops is not None:
        parts["loops"] = specimen.loops.displacement_m / geometry.L0
    if specimen.force_map is not None:
        parts["force_map"] = specimen.force_map.contraction
    if specimen.free_contraction is not None:
        parts["free_contraction"] = specimen.free_contraction.contraction
    # Beyond sin(alpha) = 1/sqrt(3) a thin-walled muscle pushes instead of pulling.
    limit = 1.0 - 1.0 / (math.sqrt(3.0) * math.sin(geometry.alpha0))
    longest = longest_contraction(geometry)
    remarks = []
    for name, contraction in parts.items():
        beyond, straight = int((contraction > limit).sum()), int((contraction <= longest).sum())
        if beyond:
            remarks.append(
                f"{name}: {beyond} rows contract further than the braid's limit of {limit:.3f} "
                f"(largest {contraction.max():.3f}); is alpha0_deg from the hoop direction?"
            )
        if straight:
            remarks.append(
                f"{name}: {straight} rows are longer than the straight strands (contraction {longest:.3f})"
            )
    return remarks
