"""Pressure that changes at held lengths: refused without a branch, but not where levels are filled."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read

from .folders import HEADER, Recording, loops, make

Array = np.ndarray


def recording(pressure: Array, displacement: Array, rate: float = 10.0) -> Recording:
    """Rows in time order with a force that follows from both."""
    force = 0.3 * pressure * (1.0 - displacement / 30.0) + 1.0
    nothing = np.zeros(len(pressure), dtype=np.int64)
    return Recording(np.arange(len(pressure)) / rate, pressure, displacement, force, nothing, nothing)


def ramps(lengths: tuple[float, ...], wait: int = 0, move: int = 0, noise: float = 0.0) -> Recording:
    """10 to 300 kPa and back at each length, after waiting; the crosshead moves at 10 kPa for some rows."""
    up = np.linspace(10.0, 300.0, 80)
    rng = np.random.default_rng(0)
    p, x, before = [], [], lengths[0]
    for length in lengths:
        way = np.linspace(before, length, move + 2)[1:-1]
        p.append(np.concatenate([np.full(move + wait, 10.0), up, up[::-1]]))
        x.append(np.concatenate([way, np.full(wait + 160, length)]))
        before = length
    pressure, displacement = np.concatenate(p), np.concatenate(x)
    pressure = pressure + noise * rng.standard_normal(len(pressure))
    return recording(pressure, displacement + 0.01 * noise * rng.standard_normal(len(pressure)))


@pytest.mark.parametrize("lengths", [(0.0, 5.0, 10.0, 15.0), (0.0, 10.0)])
@pytest.mark.parametrize(("wait", "move"), [(0, 0), (60, 0), (20, 50)])
@pytest.mark.parametrize("noise", [0.0, 1.0])
def test_ramps_at_held_lengths_need_a_branch(
    lengths: tuple[float, ...], wait: int, move: int, noise: float, tmp_path: Path
) -> None:
    made = ramps(lengths, wait, move, noise)
    with pytest.raises(InputError) as error:
        read(make(tmp_path, loops=made.text()))
    said = str(error.value).removeprefix(f"{tmp_path}/")
    assert "\n" not in said
    assert said.startswith("loops.csv:") and ":pressure_kPa: found a pressure that changes at a held " in said
    assert (" kPa at 0 mm" if not noise else " mm)") in said
    assert "branch (pressurising, depressurising)" in said


def test_the_row_and_the_pressures_are_told(tmp_path: Path) -> None:
    with pytest.raises(InputError) as error:
        read(make(tmp_path, loops=ramps((0.0, 5.0)).text()))
    said = str(error.value)
    assert "loops.csv:2:pressure_kPa: found a pressure that changes at a held length" in said
    assert "(10 to 300 kPa at 0 mm)" in said


def test_a_staircase_of_pressures_at_each_length_needs_one_too(tmp_path: Path) -> None:
    steps = np.repeat(np.arange(50.0, 301.0, 50.0), 20)
    pressure = np.tile(np.concatenate([steps, steps[::-1]]), 3)
    made = recording(pressure, np.repeat([0.0, 6.0, 12.0], len(steps) * 2))
    with pytest.raises(InputError, match="a pressure that changes at a held length"):
        read(make(tmp_path, loops=made.text()))


def test_words_that_are_given_do(tmp_path: Path) -> None:
    made = ramps((0.0, 5.0, 10.0))
    words = np.tile(np.repeat(["pressurising", "depressurising"], 80), 3)
    rows = [f"{row},{word}" for row, word in zip(made.text().splitlines()[1:], words, strict=True)]
    found = read(make(tmp_path, loops="\n".join([f"{HEADER},branch", *rows]) + "\n")).loops
    assert found is not None
    assert found.branch.tolist() == np.where(words == "pressurising", 2, -2).tolist()


def test_filling_before_the_strokes_is_no_excuse_for_metres(tmp_path: Path) -> None:
    """Rows at held length need not move; those of strokes must, and in millimetres."""
    made = loops((50.0, 100.0, 150.0))
    words = np.where(made.branch > 0, "loading", "unloading").astype("<U14")
    words[:20] = "pressurising"

    def text(scale: float) -> str:
        cells = zip(made.time, made.pressure, scale * made.displacement, made.force, words, strict=True)
        return "\n".join([f"{HEADER},branch", *(",".join(map(str, row)) for row in cells)]) + "\n"

    assert read(make(tmp_path / "mm", loops=text(1.0))).loops is not None
    for scale, said in ((1e-3, "metres"), (0.0, "never moves")):
        with pytest.raises(InputError, match=said):
            read(make(tmp_path / said, loops=text(scale)))


def filled(start: float, end: float, rows: int, wait: int) -> Array:
    return np.concatenate([np.linspace(start, end, rows), np.full(wait, end)])


@pytest.mark.parametrize("where", ["before the first", "at L0", "at both ends"])
@pytest.mark.parametrize("vented", [False, True])
@pytest.mark.parametrize("rows", [5, 300])
def test_filling_while_the_crosshead_stands_stays_what_it_was(
    where: str, vented: bool, rows: int, tmp_path: Path
) -> None:
    """Slow or quick, before the test or between levels, up alone or down to nothing first."""
    p: list[Array] = []
    x: list[Array] = []
    last, place = 0.0, 0.0
    for level in (50.0, 100.0, 200.0, 300.0):
        low = 0.0 if vented else last
        parts = [filled(last, low, rows, 10)] if vented else []
        stand = np.concatenate([*parts, filled(low, level, rows, 20)])
        if where != "before the first" or not p:
            p.append(stand)
            x.append(np.full(len(stand), place))
        top = 3.0 + 0.05 * level
        way = np.concatenate([np.linspace(0.0, top, 60), np.linspace(top, 0.0, 60)])
        if where == "at both ends":  # out under one level, and back under the next
            way = np.linspace(place, top if place == 0.0 else 0.0, 60)
            place = float(way[-1])
        p.append(np.full(len(way), level))
        x.append(way)
        last = level
    made = recording(np.concatenate(p), np.concatenate(x))
    specimen = read(make(tmp_path, loops=made.text()))
    assert specimen.loops is not None
    if where == "at both ends" and rows == 300:
        return  # so slowly that the ramps outweigh the strokes; the levels are read as they were
    for level in (50e3, 100e3, 200e3, 300e3):
        assert np.abs(specimen.levels_Pa - level).min() < 0.03 * level


def test_one_level_whose_export_begins_and_ends_without_pressure(tmp_path: Path) -> None:
    """A leak test at twice the level comes first."""
    way = np.concatenate([np.linspace(0.0, 15.0, 100), np.linspace(15.0, 3.0, 80)])
    before = np.concatenate([filled(0.0, 400.0, 100, 50), filled(400.0, 200.0, 50, 50)])
    pressure = np.concatenate([before, np.full(len(way), 200.0), filled(200.0, 0.0, 200, 20)])
    x = np.concatenate([np.zeros(len(before)), way, np.full(220, 3.0)])
    declared = make(tmp_path, loops=recording(pressure, x).text())
    toml = declared / "specimen.toml"
    toml.write_text(toml.read_text().replace('"linear"', '"constant"'))
    assert read(declared).loops is not None


def test_glitches_of_a_gauge_are_no_ramps(tmp_path: Path) -> None:
    made = loops(dwell=40, cycles=3)
    made.pressure[::97] *= 4.0
    assert read(make(tmp_path, loops=made.text())).loops is not None
