"""Strokes of one direction: the way back was not recorded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.specimen import read

from .folders import HEADER, loops, make

LEVELS = (100.0, 200.0, 300.0, 400.0)
SPEED = 8.0
"""mm/s: 0.8 mm from row to row at 10 Hz, so that every stroke has 13 rows or more."""


@pytest.mark.parametrize("columns", [(), ("branch",), ("setpoint_kPa", "branch")])
@pytest.mark.parametrize("direction", [1, -1])
def test_each_is_a_stroke_and_a_cycle_of_its_level(
    tmp_path: Path, direction: int, columns: tuple[str, ...]
) -> None:
    whole = loops(LEVELS, cycles=2, speeds=(SPEED,), pressure_sd=0.3)
    kept = whole.branch == direction
    word = "loading" if direction == 1 else "unloading"
    setpoint = np.round(whole.pressure / 100.0) * 100.0
    beside = {"branch": [word] * len(kept), "setpoint_kPa": [f"{p:g}" for p in setpoint]}
    lines = [",".join([HEADER, *columns])]
    for i in np.flatnonzero(kept):
        lines.append(",".join([*(f"{v:.5f}" for v in whole.columns()[i]), *(beside[c][i] for c in columns)]))
    specimen = read(make(tmp_path, loops="\n".join(lines) + "\n"))
    found = specimen.loops
    assert found is not None
    assert specimen.levels_Pa == pytest.approx(1e3 * np.array(LEVELS), rel=0.01)
    first, rows = found.strokes
    long = rows > 3
    assert long.sum() == 2 * len(LEVELS)
    assert found.cycle[first[long]].tolist() == [1, 2] * len(LEVELS)
    assert set(found.branch[first[long]].tolist()) == {direction}
    assert draw_blueprint(specimen).speed == pytest.approx(SPEED * 1e-3, rel=0.05)


@pytest.mark.parametrize("rows", [1, 3])
@pytest.mark.parametrize("direction", [1, -1])
def test_a_dropout_of_the_displacement_is_no_way_back(tmp_path: Path, direction: int, rows: int) -> None:
    recording = loops(cycles=3)
    word = {1: "loading", -1: "unloading"}
    columns = recording.columns()
    one = (recording.branch == direction) & (recording.cycle == 2) & (recording.pressure == 50.0)
    stroke = np.flatnonzero(one)
    far_out, far_in = (int(share * len(stroke)) for share in ((0.3, 0.7) if direction == 1 else (0.7, 0.3)))
    columns[stroke[far_out] : stroke[far_out] + rows, 2] = 0.0
    columns[stroke[far_in] : stroke[far_in] + rows, 2] = 7.5
    lines = [f"{HEADER},branch"]
    for row, branch in zip(columns, recording.branch, strict=True):
        lines.append(",".join([*(f"{value:.5f}" for value in row), word[int(branch)]]))
    found = read(make(tmp_path, loops="\n".join(lines) + "\n")).loops
    assert found is not None
    assert np.array_equal(found.cycle, recording.cycle)
    assert len(found.strokes[0]) == 18
