"""Setpoints group rows into levels, whether they were commanded or read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.specimen import Specimen, read

from .folders import HEADER, Recording, loops, make


def with_setpoints(folder: Path, recording: Recording, setpoint: np.ndarray) -> Specimen:
    body = recording.text().splitlines()[1:]
    rows = [f"{row},{value:.6g}" for row, value in zip(body, setpoint, strict=True)]
    return read(make(folder, loops="\n".join([f"{HEADER},setpoint_kPa", *rows]) + "\n"))


def test_setpoints_that_are_read_back_make_the_levels_that_there_are(tmp_path: Path) -> None:
    recording = loops((50.0, 100.0, 150.0), rate=20.0)
    noise = 0.05 * np.random.default_rng(0).standard_normal(len(recording.time))
    specimen = with_setpoints(tmp_path, recording, recording.pressure + noise)
    assert specimen.levels_Pa == pytest.approx([50e3, 100e3, 150e3])
    assert specimen.loops is not None
    assert np.array_equal(specimen.levels_Pa[specimen.loops.level], recording.pressure * 1e3)


def test_setpoints_that_read_alike_are_one_level(tmp_path: Path) -> None:
    recording = loops((50.0, 100.0, 110.0))
    setpoint = recording.pressure.copy()
    recording.pressure[setpoint == 110.0] = 100.0
    specimen = with_setpoints(tmp_path, recording, setpoint)
    assert specimen.levels_Pa == pytest.approx([50e3, 100e3])
    note = "loops: 3 setpoints are 2 levels, for some read the same pressure"
    assert note in specimen.notes
