"""Reading force-displacement loops: one or several files, each with its own clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.specimen.clock import Clock
from mpam_calib.specimen.cycles import cycles_at_turns, number_cycles, returns
from mpam_calib.specimen.declaration import Geometry
from mpam_calib.specimen.filling import filled_rows, held_rows
from mpam_calib.specimen.held_length import check_held_length
from mpam_calib.specimen.levels import setpoint_levels, setpoint_notes, sorted_levels, stroke_levels
from mpam_calib.specimen.motion import (
    Motion,
    noise_sd,
    read_motion,
    run_ids,
    run_starts,
    turn_threshold,
)
from mpam_calib.specimen.plausibility import (
    check_branch,
    check_changes,
    check_codes,
    check_displacement,
    check_force,
    check_pressure,
)
from mpam_calib.specimen.recording import DEPRESSURISING, PRESSURISING, Bools, Floats, Ints, Loops
from mpam_calib.specimen.reduction import average_rows, rows_per_mean
from mpam_calib.specimen.source import DataFile
from mpam_calib.specimen.summary import noise_within
from mpam_calib.specimen.tables import GAPPED_COLUMNS
from mpam_calib.specimen.wording import listed
from mpam_calib.units import KPA, MM


@dataclass(frozen=True)
class LoopsRead:
    """Loops whose ``level`` indexes their own ``levels_Pa``, and what the reader did to them."""

    loops: Loops
    levels_Pa: Floats
    rows: tuple[int, ...]
    notes: tuple[str, ...]
    by_setpoint: bool = False


class _RowNoise(NamedTuple):
    """Of a block: its rows, and the white noise (N) of one of them."""

    rows: int
    sd: float


def read_loops(files: Sequence[DataFile], geometry: Geometry, floor_N: float | None) -> LoopsRead:
    """Read the loops files in the order given and sort out levels, branches, cycles and strokes.

    Raises ``InputError`` for anything in a file that cannot be used.
    """
    wanted = rows_per_mean(sum(file.estimated_rows for file in files))
    frames, clocks, noises = [], [], []
    for file in files:
        frame, read, noise = _read_file(file, wanted, floor_N)
        _check_plausible(file, frame, geometry)
        frames.append(frame)
        clocks.append(read)
        noises += noise
    counts = [read.rows for read in clocks]
    # Turns, steps and gaps part the groups: where there are many, fewer rows make a mean.
    averaged = max(1, round(sum(counts) / sum(map(len, frames))))
    clock = np.repeat(np.arange(len(frames)), [len(frame) for frame in frames])
    everywhere = set.intersection(*(set(frame.columns) for frame in frames))
    level, (branch, unclear), filled = _levels_and_motion(frames, clock, "setpoint_kPa" in everywhere)
    times = [frame["time_s"].to_numpy() for frame in frames]
    notes = [
        *_notes_of_files(files, frames, clocks, averaged),
        *_notes_of_rows_left_out(unclear & ~filled, filled),
        *_notes_of_clocks(times),
    ]
    rows = pd.concat([frame[sorted(everywhere)] for frame in frames], ignore_index=True)
    pressure = rows["pressure_kPa"].to_numpy() * KPA
    apart = len(np.unique(level))
    level, levels_Pa = sorted_levels(pressure, level, filled)
    if len(levels_Pa) < apart:
        notes.append(f"loops: {apart} setpoints are {len(levels_Pa)} levels, for some read the same pressure")
    _check_levels(files, frames, clock, level, levels_Pa)
    if "setpoint_kPa" in everywhere:
        notes += setpoint_notes(rows["setpoint_kPa"].to_numpy() * KPA, level, levels_Pa)
    displacement = rows["displacement_mm"].to_numpy() * MM
    returned = returns(displacement, level, branch)
    cycle = _cycles(rows, level, clock, branch, returned)
    time, began = one_after_the_other(times)
    loops = Loops(
        time_s=time,
        pressure_Pa=pressure,
        displacement_m=displacement,
        force_N=rows["force_N"].to_numpy(),
        level=level,
        cycle=cycle,
        branch=branch,
        stroke=run_ids(clock, level, cycle, branch, returned),
        clock=clock,
        began_s=began,
        censored=rows["censored"].to_numpy() > 0.5,
        averaged=averaged,
        noise_N=_together(noises) if averaged > 1 else 0.0,
        unclear=unclear if unclear.any() else None,
        temperature_C=rows["temperature_C"].to_numpy() if "temperature_C" in everywhere else None,
    )
    return LoopsRead(loops, levels_Pa, tuple(counts), tuple(notes), "setpoint_kPa" in everywhere)


def _cycles(rows: pd.DataFrame, level: Ints, clock: Ints, branch: Ints, returned: Ints) -> Ints:
    """The cycles (rows,) as they are written, moved to the turns that were found; counted where none are."""
    if "cycle" not in rows:
        return number_cycles(level, clock, branch, returned)
    cycle = rows["cycle"].to_numpy().astype(np.int64)
    return cycle if "branch" in rows else cycles_at_turns(cycle, run_ids(clock, level), branch)


def _notes_of_files(
    files: Sequence[DataFile], frames: Sequence[pd.DataFrame], clocks: Sequence[Clock], averaged: int
) -> list[str]:
    """Ticks that were spread, rows that were averaged, and columns that not every file has."""
    notes = [
        f"loops: {read.repeated} of {read.rows} readings of {read.file.label} have the time of the one "
        "before; those of a tick are taken as evenly spaced up to the next"
        for read in clocks
        if read.coarse
    ]
    if averaged > 1:
        count = sum(read.rows for read in clocks)
        notes.append(f"loops: {count} rows were averaged {averaged} at a time while reading")
    for name in ("setpoint_kPa", "cycle"):
        without = [file.label for file, frame in zip(files, frames, strict=True) if name not in frame]
        if without and len(without) < len(files):
            notes.append(f"loops: {name} is not in {listed(without, 3)} and was not used in the others")
    return notes


def _notes_of_rows_left_out(turning: NDArray[np.bool_], filled: NDArray[np.bool_]) -> list[str]:
    notes = []
    if turning.any():
        notes.append(
            f"loops: {int(turning.sum())} readings at turns and beside holds are left out: their "
            "displacement does not tell the branch (a column branch would)"
        )
    if filled.any():
        notes.append(
            f"loops: {int(filled.sum())} readings at held length are left out: their pressure is on its way, "
            "or already another than their stroke's (a column branch would tell what they are)"
        )
    return notes


def _notes_of_clocks(times: Sequence[Floats]) -> list[str]:
    anew = sum(bool(after[0] <= before[-1]) for before, after in pairwise(times))
    if not anew:
        return []
    return [
        f"loops: the clock begins anew in {anew} of {len(times)} files; they count as recorded in the "
        "order given, without a pause"
    ]


def one_after_the_other(times: Sequence[Floats]) -> tuple[Floats, Floats]:
    """The test's time since its first reading, s, and when on it each row's clock began.

    A file whose clock has begun anew follows the one before, as if without a pause: what goes on over the
    whole test (a load cell's drift) goes on over its files, unless the cell was tared before each.
    """
    found, began = [times[0] - times[0][0]], [np.zeros(len(times[0]))]
    for before, time in pairwise(times):
        if time[0] > before[-1]:
            start, first = float(began[-1][-1]), float(found[-1][-1]) + float(time[0] - before[-1])
        else:
            step = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
            start = first = float(found[-1][-1]) + step
        found.append(time - time[0] + first)
        began.append(np.full(len(time), start))
    return np.concatenate(found), np.concatenate(began)


def _read_file(
    file: DataFile, averaged: int, floor_N: float | None
) -> tuple[pd.DataFrame, Clock, list[_RowNoise]]:
    """A file's rows (averaged where it is very large) with a ``censored`` column, its clock and its noise."""
    kept: list[pd.DataFrame] = []
    noises: list[_RowNoise] = []
    clock = Clock(file)
    for block in clock.blocks():
        censored = censored_rows(block, floor_N)
        if averaged > 1:
            # Noise that lasts for some rows stays in their mean: what one row has only the rows tell.
            one = np.zeros(len(block), dtype=np.int64)
            noises.append(_RowNoise(len(block), noise_within(block["force_N"].to_numpy(), one)))
            block, censored = average_rows(block, averaged, censored)
        kept.append(block.assign(censored=censored.astype(float)))
    frame = pd.concat(kept)
    if "branch" in frame and not frame["branch"].any():
        frame = frame.drop(columns="branch")  # empty all along: not given
    for name in GAPPED_COLUMNS.intersection(frame.columns):
        frame[name] = frame[name].interpolate(limit_direction="both")
    return frame.dropna(axis="columns"), clock, noises


def _together(noises: Sequence[_RowNoise]) -> float:
    """The noise of all blocks, N, by their rows."""
    told = np.array([noise for noise in noises if noise.sd >= 0.0])  # nan: too few rows to tell
    return float(np.sqrt(np.average(told[:, 1] ** 2, weights=told[:, 0]))) if len(told) else 0.0


def censored_rows(frame: pd.DataFrame, floor_N: float | None) -> Bools:
    """Rows that say "slack": flagged in ``censored``, or reading at or below the floor."""
    censored = np.zeros(len(frame), dtype=bool)
    if "censored" in frame:
        censored |= frame["censored"].to_numpy() == 1.0
    if floor_N is not None:
        censored |= frame["force_N"].to_numpy() <= floor_N
    return censored


def _check_plausible(file: DataFile, frame: pd.DataFrame, geometry: Geometry) -> None:
    # Where the muscle is filled and emptied at held length it need not move.
    strokes = np.ones(len(frame), dtype=bool)
    if "branch" in frame and frame["branch"].isin([PRESSURISING, DEPRESSURISING]).any():
        strokes = (frame["branch"].abs() == 1).to_numpy()
    rows = frame.index.to_numpy()
    displacement = frame["displacement_mm"].to_numpy()
    check_codes(file.label, frame)
    check_displacement(file.label, displacement * MM, rows, geometry, strokes)
    if "branch" not in frame:
        check_held_length(file.label, displacement, frame["pressure_kPa"].to_numpy(), rows)
    check_force(file.label, "loops", frame["force_N"].to_numpy(), displacement)
    check_changes(file.label, frame["force_N"].to_numpy(), "force_N")
    if "branch" in frame:
        branch = frame["branch"].to_numpy().astype(np.int64)
        check_branch(file.label, branch, displacement * MM, rows)


def _levels_and_motion(
    frames: Sequence[pd.DataFrame], clock: Ints, setpoints: bool
) -> tuple[Ints, Motion, Bools]:
    """Level (in any order) and motion of every row, and whether the muscle was then filled or vented.

    Strokes tell the levels, and a level's own rows tell its strokes: a jump of the crosshead
    between two levels is no stroke. So the motion is looked at twice.
    """

    def column(name: str) -> Floats:
        return np.concatenate([frame[name].to_numpy() for frame in frames])

    rough = [_motion(frame, np.zeros(len(frame), dtype=np.int64)).branch for frame in frames]
    branch = np.concatenate(rough)
    units = run_ids(clock, branch)
    if setpoints:
        level = setpoint_levels(column("setpoint_kPa") * KPA, column("displacement_mm"), branch, units)
    else:
        # At held length the pressure may be on its way to the next level.
        held = np.concatenate([_held(*pair) for pair in zip(frames, rough, strict=True)])
        units = run_ids(clock, branch, held.astype(np.int64))
        level = stroke_levels(column("pressure_kPa") * KPA, units, np.where(held, PRESSURISING, branch))
    parts = list(zip(frames, rough, np.split(level, _ends(frames)), strict=True))
    motion = _joined([_motion(frame, run_ids(part)) for frame, _, part in parts])
    filled = np.concatenate([_filled(*part) for part in parts])
    return level, motion._replace(unclear=motion.unclear | filled), filled


def _held(frame: pd.DataFrame, branch: Ints) -> Bools:
    """Rows (rows,) at held length that are not at their stroke's level, where motion tells the branch."""
    if "branch" in frame:
        return np.zeros(len(frame), dtype=bool)
    return held_rows(frame["displacement_mm"].to_numpy(), frame["pressure_kPa"].to_numpy(), branch)


def _filled(frame: pd.DataFrame, branch: Ints, level: Ints) -> Bools:
    """Rows (rows,) at held length at another pressure than their stroke's, where no column says so."""
    if "branch" in frame:
        return np.zeros(len(frame), dtype=bool)
    return filled_rows(frame["displacement_mm"].to_numpy(), frame["pressure_kPa"].to_numpy(), branch, level)


def _ends(frames: Sequence[pd.DataFrame]) -> Ints:
    return np.cumsum([len(frame) for frame in frames])[:-1].astype(np.int64)


def _joined(parts: Sequence[Motion]) -> Motion:
    return Motion(np.concatenate([p.branch for p in parts]), np.concatenate([p.unclear for p in parts]))


def _motion(frame: pd.DataFrame, runs: Ints) -> Motion:
    """Branch codes as the file gives them, else from the motion within each run."""
    if "branch" in frame:
        return Motion(frame["branch"].to_numpy().astype(np.int64), np.zeros(len(frame), dtype=bool))
    displacement = frame["displacement_mm"].to_numpy()
    threshold, sd = turn_threshold(displacement), noise_sd(displacement)
    pieces = np.split(displacement, run_starts(runs)[1:])
    return _joined([read_motion(piece, threshold, sd) for piece in pieces])


def _check_levels(
    files: Sequence[DataFile], frames: Sequence[pd.DataFrame], clock: Ints, level: Ints, levels_Pa: Floats
) -> None:
    rows = np.concatenate([frame.index.to_numpy() for frame in frames])
    for i in range(len(files)):
        here = clock == i
        check_pressure(files[i].label, "loops", levels_Pa[level[here]], rows[here])
