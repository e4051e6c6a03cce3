"""Pressure raised while the crosshead stands, with and without a column that says so."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mpam_calib.specimen import Specimen, read

from .folders import DECLARATION, HEADER, make

LEVELS = (80.0, 160.0, 240.0)
STROKE, TOP_MM, K_F = 100, 12.0, 0.08


@dataclass(frozen=True)
class Filled:
    """Rows of a test whose levels are filled at L0; ``way`` is +-1, or 0 at held length."""

    pressure: NDArray[np.float64]
    displacement: NDArray[np.float64]
    way: NDArray[np.int64]


def filled(ramp: int, dwell: int, lag: float = 0.0) -> Filled:
    """One cycle a level after ``ramp`` rows of filling and ``dwell`` at its pressure; ``lag`` in motion."""
    rng = np.random.default_rng(5)
    p, x, way = [], [], []
    last = 0.0
    for level in LEVELS:
        p.append(np.concatenate([np.linspace(last, level, ramp + 1)[1:], np.full(dwell + 2 * STROKE, level)]))
        out = np.linspace(0.0, TOP_MM, STROKE)
        x.append(np.concatenate([np.zeros(ramp + dwell), out, out[::-1]]))
        way.append(np.repeat([0, -1, 1], [ramp + dwell, STROKE, STROKE]))
        last = level
    pressure, displacement, moving = np.concatenate(p), np.concatenate(x), np.concatenate(way)
    pressure = pressure * (1.0 - lag * moving) + 0.1 * rng.standard_normal(len(pressure))
    return Filled(pressure, displacement + 0.003 * rng.standard_normal(len(pressure)), moving)


def reading(folder: Path, made: Filled, words: bool, setpoint: bool = False) -> Specimen:
    force = 0.3 * made.pressure * (1.0 - made.displacement / 30.0) * (1.0 + K_F * made.way)
    columns = [0.1 * np.arange(len(force)), made.pressure, made.displacement, force]
    header = HEADER
    if setpoint:
        header += ",setpoint_kPa"
        columns.append(np.repeat(LEVELS, len(force) // len(LEVELS)))
    lines = [",".join(f"{value:.4f}" for value in row) for row in zip(*columns, strict=True)]
    if words:
        header += ",branch"
        names = {1: "loading", -1: "unloading", 0: "pressurising"}
        lines = [f"{line},{names[int(way)]}" for line, way in zip(lines, made.way, strict=True)]
    return read(make(folder, DECLARATION, loops="\n".join([header, *lines]) + "\n"))


@pytest.mark.parametrize("setpoint", [False, True])
@pytest.mark.parametrize("lag", [0.0, 0.01])
@pytest.mark.parametrize(("ramp", "dwell"), [(5, 0), (10, 0), (25, 10), (60, 30), (60, 200), (300, 0)])
def test_the_rows_used_are_those_that_a_column_tells(
    tmp_path: Path, ramp: int, dwell: int, lag: float, setpoint: bool
) -> None:
    made = filled(ramp, dwell, lag)
    given = reading(tmp_path / "given", made, words=True, setpoint=setpoint)
    told = reading(tmp_path / "told", made, words=False, setpoint=setpoint)
    for specimen in (given, told) if ramp < STROKE else (told,):
        assert specimen.levels_Pa / 1e3 == pytest.approx(LEVELS, rel=2e-3 + lag)
    assert told.loops is not None and told.loops.unclear is not None and given.loops is not None
    used = ~told.loops.unclear
    assert any("readings at held length are left out" in note for note in told.notes)
    # Within the noise of the gauge, or its last hundredth, a pressure has not left its stroke's yet.
    assert np.count_nonzero(used & (made.way == 0)) <= 0.025 * len(LEVELS) * ramp + 2
    assert np.count_nonzero(~used & (made.way != 0)) <= 3 * len(LEVELS)
    both = used & (made.way != 0)
    assert (told.loops.branch == made.way)[both].all()
    assert (told.loops.level == given.loops.level)[both].all()
    for level in range(len(LEVELS)):
        for way in (-1, 1):
            forces = [
                np.median(loops.force_N[rows & (loops.level == level) & (loops.branch == way)])
                for loops, rows in ((told.loops, used), (given.loops, np.ones_like(used)))
            ]
            # Of a slow ramp some rows still lie within the lag of the regulator.
            assert forces[0] == pytest.approx(forces[1], rel=0.02 if ramp < STROKE else 0.04)


@pytest.mark.parametrize("droop", [0.0, 0.01, 0.04])
@pytest.mark.parametrize("lag", [0.0, 0.02])
def test_a_dwell_at_a_turn_stays_with_its_stroke(tmp_path: Path, lag: float, droop: float) -> None:
    """While the regulator settles, and a level leaks, too; friction fades at rest, which the model knows."""
    out = np.linspace(0.0, TOP_MM, STROKE)
    rest = 40
    x = np.tile(np.concatenate([out, np.full(rest, TOP_MM), out[::-1], np.zeros(rest)]), 4)
    way = np.tile(np.repeat([-1, 0, 1, 0], [STROKE, rest, STROKE, rest]), 4)
    level = np.repeat([100.0, 200.0], len(x) // 2)
    leak = np.concatenate([np.zeros(STROKE), np.linspace(0.0, droop, rest), np.zeros(STROKE + rest)])
    pressure = level * (1.0 - lag * way) * (1.0 - np.tile(leak, 4))
    rng = np.random.default_rng(3)
    pressure = pressure + 0.05 * rng.standard_normal(len(x))
    made = Filled(pressure, x + 0.003 * rng.standard_normal(len(x)), way)
    found = reading(tmp_path, made, words=False).loops
    assert found is not None
    lost = np.zeros(len(x), dtype=bool) if found.unclear is None else found.unclear
    assert np.count_nonzero(lost) <= 3 * 8
    held = (way == 0) & ~lost
    assert (found.branch[held] == np.where(x > 0.5 * TOP_MM, -1, 1)[held]).all()
