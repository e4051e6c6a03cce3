"""Reading the files without a clock: force maps, blocked forces, free contractions, tensile tests."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import Geometry
from mpam_calib.specimen.levels import medians_by_label, static_levels
from mpam_calib.specimen.loops import censored_rows
from mpam_calib.specimen.plausibility import (
    check_changes,
    check_codes,
    check_contraction,
    check_force,
    check_pressure,
    check_strain,
    map_hint,
)
from mpam_calib.specimen.recording import BlockedForce, Floats, ForceMap, FreeContraction, Tensile
from mpam_calib.specimen.source import DataFile
from mpam_calib.units import KPA


@dataclass(frozen=True)
class ForceMapRead:
    """A force map whose ``level`` indexes its own ``levels_Pa``."""

    force_map: ForceMap
    levels_Pa: Floats
    rows: tuple[int, ...]


def read_force_map(files: Sequence[DataFile], geometry: Geometry, floor_N: float | None) -> ForceMapRead:
    """Read force maps; repeated readings of one point stay separate rows, each with its own noise."""
    frames = _frames(files, geometry, floor_N)
    rows = pd.concat(frames, ignore_index=True)
    pressure = rows["pressure_kPa"].to_numpy() * KPA
    level = static_levels(pressure)
    given = rows["branch"].fillna(0).to_numpy() if "branch" in rows else np.zeros(len(rows))
    force_map = ForceMap(
        pressure_Pa=pressure,
        contraction=rows["contraction"].to_numpy(),
        force_N=rows["force_N"].to_numpy(),
        level=level,
        branch=given.astype(np.int64),
        censored=censored_rows(rows, floor_N),
    )
    return ForceMapRead(force_map, medians_by_label(pressure, level), tuple(map(len, frames)))


def read_blocked_force(
    files: Sequence[DataFile], geometry: Geometry, floor_N: float | None
) -> tuple[BlockedForce, tuple[int, ...]]:
    """Read blocked forces, and the number of rows of each file."""
    frames = _frames(files, geometry, floor_N)
    rows = pd.concat(frames, ignore_index=True)
    blocked = BlockedForce(
        rows["pressure_kPa"].to_numpy() * KPA, rows["force_N"].to_numpy(), censored_rows(rows, floor_N)
    )
    return blocked, tuple(map(len, frames))


def read_free_contraction(
    files: Sequence[DataFile], geometry: Geometry
) -> tuple[FreeContraction, tuple[int, ...]]:
    """Read free contractions, and the number of rows of each file."""
    frames = _frames(files, geometry)
    rows = pd.concat(frames, ignore_index=True)
    free = FreeContraction(rows["pressure_kPa"].to_numpy() * KPA, rows["contraction"].to_numpy())
    return free, tuple(map(len, frames))


def read_tensile(files: Sequence[DataFile]) -> tuple[Tensile, tuple[int, ...]]:
    """Read tensile tests, and the number of rows of each file."""
    frames = []
    for file in files:
        frame = file.whole()
        stress = float(frame["stress_Pa"].median())
        if stress < 0.0:
            expected = f"tension above 0; {map_hint('tensile', 'stress_Pa', '-1.0')}"
            found = f"a median stress of {stress:.3g} Pa (flipped sign?)"
            raise InputError(file.label, found, expected, None, "stress_Pa")
        check_codes(file.label, frame)
        check_strain(file.label, frame["strain"].to_numpy(), frame.index.to_numpy())
        check_changes(file.label, frame["stress_Pa"].to_numpy(), "stress_Pa")
        frames.append(frame)
    rows = pd.concat(frames, ignore_index=True)
    return Tensile(rows["strain"].to_numpy(), rows["stress_Pa"].to_numpy()), tuple(map(len, frames))


def _frames(
    files: Sequence[DataFile], geometry: Geometry, floor_N: float | None = None
) -> list[pd.DataFrame]:
    frames = []
    for file in files:
        frame = file.whole()
        rows = frame.index.to_numpy()
        check_codes(file.label, frame)
        check_pressure(file.label, file.kind, frame["pressure_kPa"].to_numpy() * KPA, rows)
        if "force_N" in frame:
            # Zeros that a slack muscle reads say nothing of the sign.
            pulls = frame["force_N"].to_numpy()[~censored_rows(frame, floor_N)]
            if len(pulls):
                check_force(file.label, file.kind, pulls)
        if "contraction" in frame:
            contraction = frame["contraction"].to_numpy()
            check_contraction(file.label, contraction, rows, geometry, file.kind, "contraction")
        frames.append(frame)
    return frames
