"""Setpoints group rows into levels, whether they were commanded or read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import Specimen, read
from mpam_calib.specimen.levels import same_level

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


def test_setpoints_that_are_read_back_and_dwell_make_the_levels_that_there_are(tmp_path: Path) -> None:
    """Their last digit flickers every second, or drifts for minutes: longer than noise stays."""
    recording = loops((50.0, 100.0, 150.0), cycles=3, rate=20.0, pressure_sd=0.3)
    commanded = 50.0 * np.round(recording.pressure / 50.0)
    rows = np.arange(len(commanded))
    flicker = 0.1 * np.repeat(np.random.default_rng(1).random(len(rows) // 20 + 1) < 0.5, 20)[: len(rows)]
    drift = np.round(0.3 * np.sin(rows / 150.0), 1)
    for name, error in (("flickers", flicker), ("drifts", drift)):
        specimen = with_setpoints(tmp_path / name, recording, commanded + error)
        assert specimen.levels_Pa == pytest.approx([50e3, 100e3, 150e3], abs=100.0), name
        assert specimen.loops is not None
        assert specimen.loops.cycle.max() == 3, name


@pytest.mark.parametrize("dwell", [0, 40])
def test_setpoints_that_are_commanded_may_lie_close_together(tmp_path: Path, dwell: int) -> None:
    """They change at turns, or within holds."""
    recording = loops((300.0, 301.0, 302.0), cycles=1, rate=20.0, dwell=dwell)
    setpoint = np.roll(recording.pressure, -dwell // 2)
    setpoint[len(setpoint) - dwell :] = 302.0
    specimen = with_setpoints(tmp_path, recording, setpoint)
    assert specimen.levels_Pa == pytest.approx([300e3, 301e3, 302e3])


@pytest.mark.parametrize("size", [0.0, 0.1])
def test_a_ramp_between_two_setpoints_read_back_is_no_level(tmp_path: Path, size: float) -> None:
    recording = loops((50.0, 100.0, 150.0), cycles=2, rate=20.0, dwell=40, pressure_sd=0.3)
    commanded = 50.0 * np.round(recording.pressure / 50.0)
    flicker = size * (np.arange(len(recording.time)) // 15 % 2)
    setpoint = commanded.copy()
    for change in np.flatnonzero(np.diff(commanded)):
        setpoint[change - 20 : change + 1] = np.linspace(commanded[change], commanded[change + 1], 21)
    specimen = with_setpoints(tmp_path, recording, setpoint + flicker)
    assert specimen.levels_Pa == pytest.approx([50e3, 100e3, 150e3], abs=100.0)


@pytest.mark.parametrize(
    ("factor", "setpoint", "said"),
    [
        pytest.param(1e-3, "", r"1 pressure level \(0.1 kPa: MPa\? scale = 1000 in", id="megapascals"),
        pytest.param(0.0, "", r"found no pressure level above 0 kPa \(a gauge that is not", id="nothing"),
        pytest.param(-0.01, "", r"no pressure level above -0.5 kPa \(flipped sign\?\)", id="a sign"),
        pytest.param(1.0, "100", r"level \(100 kPa, by setpoint_kPa alone: is it what was set\?\)", id="set"),
    ],
)
def test_one_level_is_named_where_the_law_needs_more(
    factor: float, setpoint: str, said: str, tmp_path: Path
) -> None:
    header, *body = loops(levels=(50.0, 100.0, 150.0)).text().splitlines()
    rows = [line.split(",") for line in body]
    for cells in rows:
        cells[1] = f"{factor * float(cells[1]):.6g}"
        cells += [setpoint] * bool(setpoint)
    header += ",setpoint_kPa" * bool(setpoint)
    with pytest.raises(InputError, match=said):
        read(make(tmp_path, loops="\n".join([header, *map(",".join, rows)]) + "\n"))


@pytest.mark.parametrize(("share", "told"), [(0.15, False), (0.25, True), (-0.25, True)])
def test_a_setpoint_far_from_its_readings_is_told(share: float, told: bool, tmp_path: Path) -> None:
    """By more than a fifth of what was set."""
    recording = loops((50.0, 100.0, 150.0), rate=20.0)
    specimen = with_setpoints(tmp_path, recording, recording.pressure / (1.0 - share))
    notes = [note for note in specimen.notes if "it only groups the rows" in note]
    assert len(notes) == told
    if told:
        said = f"setpoint_kPa is {150.0 / (1.0 - share):.4g} where pressure_kPa reads 150;"
        assert said in notes[0]


def test_levels_of_two_files_are_one_within_a_kilopascal_or_two_hundredths() -> None:
    level = 1e3 * np.array([20.0, 20.0, 200.0, 200.0])
    reading = 1e3 * np.array([20.9, 21.1, 196.1, 195.9])
    assert same_level(reading, level).tolist() == [True, False, True, False]
