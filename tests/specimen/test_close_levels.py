"""Levels that lie close together without setpoints, and regulators whose wandering makes none."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpam_calib.specimen import Specimen, read
from mpam_calib.specimen.close_levels import part_close
from mpam_calib.specimen.recording import LOADING, UNLOADING

from .folders import DECLARATION, HEADER, Recording, loops, make

CLOSE = {
    "one long row": tuple(np.arange(100.0, 501.0, 10.0)),
    "another": tuple(np.arange(50.0, 451.0, 10.0)),
    "four below a tenth of the top": (20.0, 30.0, 40.0, 50.0, 100.0, 200.0, 400.0, 600.0),
    "of 5 kPa": (5.0, 10.0, 15.0, 20.0, 50.0, 100.0, 250.0),
}
FEW = (50.0, 100.0, 150.0, 200.0)


def recorded(levels: tuple[float, ...], cycles: int = 1, dwell: int = 0) -> Recording:
    """Some twenty rows a stroke; a gauge's noise of 0.05 kPa."""
    return loops(levels, cycles, speeds=(10.0,), rate=20.0, dwell=dwell, pressure_sd=0.05, encoder_sd=0.002)


def found(folder: Path, made: Recording, words: bool = False) -> Specimen:
    header, *lines = made.text().splitlines()
    if words:
        named = np.where(made.branch == 1, "loading", "unloading")
        header, lines = f"{header},branch", [f"{a},{b}" for a, b in zip(lines, named, strict=True)]
    # One level is enough for this law: how many there are is what is asked.
    text = "\n".join([header, *lines]) + "\n"
    return read(make(folder, DECLARATION.replace('"linear"', '"constant"'), loops=text))


def levels_and_cycles(specimen: Specimen) -> tuple[list[float], list[int]]:
    assert specimen.loops is not None
    level, cycle = specimen.loops.level, specimen.loops.cycle
    counts = [len(np.unique(cycle[level == i])) for i in range(len(specimen.levels_Pa))]
    return (specimen.levels_Pa / 1e3).tolist(), counts


@pytest.mark.parametrize("name", CLOSE)
@pytest.mark.parametrize(
    ("cycles", "dwell", "lag", "words"), [(1, 0, 0.0, False), (2, 30, 0.0, False), (1, 0, 0.02, True)]
)
def test_levels_nearer_than_a_lag_at_the_top(
    tmp_path: Path, name: str, cycles: int, dwell: int, lag: float, words: bool
) -> None:
    """Also where each direction is 2 % off, by more than the next level is."""
    made = recorded(CLOSE[name], cycles, dwell)
    made = replace(made, pressure=made.pressure * (1.0 - lag * made.branch))
    levels, counts = levels_and_cycles(found(tmp_path, made, words))
    assert levels == pytest.approx(list(CLOSE[name]), abs=0.1, rel=2e-3)
    assert counts == [cycles] * len(levels)


def test_levels_of_a_hundredth_where_each_is_repeated(tmp_path: Path) -> None:
    assert levels_and_cycles(found(tmp_path, recorded((300.0, 303.0, 306.0), 2)))[1] == [2, 2, 2]


@pytest.mark.parametrize("levels", [FEW, (300.0,), (20.0, 60.0, 100.0, 400.0)])
@pytest.mark.parametrize("lag", [0.0, 0.01, 0.03])
@pytest.mark.parametrize("drift", [0.0, 0.01, -0.02])
def test_a_lag_and_a_drift_make_no_levels(
    tmp_path: Path, drift: float, lag: float, levels: tuple[float, ...]
) -> None:
    """Directions up to 6 % apart, and every cycle 1 or 2 % off the one before."""
    made = recorded(levels, 3)
    factor = (1.0 - lag * made.branch) * (1.0 + drift * (made.cycle - 1))
    specimen = found(tmp_path, replace(made, pressure=made.pressure * factor))
    assert levels_and_cycles(specimen)[1] == [3] * len(levels)


@pytest.mark.parametrize("cycles", [2, 3, 4])
@pytest.mark.parametrize("both", [False, True])
def test_cycles_that_wander_by_some_kPa_make_no_levels(tmp_path: Path, both: bool, cycles: int) -> None:
    """Every one by 1 kPa (sd) anew, at 50 kPa and at 200; also with strokes of one direction alone."""
    rng = np.random.default_rng(cycles)
    for trial in range(4):
        made = recorded(FEW, cycles)
        own = np.cumsum(np.diff(made.cycle, prepend=0) != 0) - 1
        made = replace(made, pressure=made.pressure + rng.normal(size=own.max() + 1)[own])
        if not both:
            kept = made.branch == 1
            made = Recording(*(column[kept] for column in vars(made).values()))
        specimen = found(tmp_path / str(trial), made, words=not both)
        assert len(specimen.levels_Pa) == len(FEW)


def test_a_pressure_that_droops_along_a_stroke_is_one_level(tmp_path: Path) -> None:
    made = recorded(FEW, 2)
    droop = 1.0 - 0.06 * made.displacement / 15.0
    assert levels_and_cycles(found(tmp_path, replace(made, pressure=made.pressure * droop)))[1] == [2] * 4


def test_levels_of_a_single_direction_are_as_they_were(tmp_path: Path) -> None:
    """Without a way back a change of level looks like a regulator that wanders."""
    made = recorded((100.0, 200.0, 204.0, 300.0))
    kept = made.branch == 1
    lines = [f"{a},loading" for a, one in zip(made.text().splitlines()[1:], kept, strict=True) if one]
    specimen = read(make(tmp_path, loops="\n".join([f"{HEADER},branch", *lines]) + "\n"))
    assert specimen.levels_Pa / 1e3 == pytest.approx([100.0, 202.0, 300.0], abs=2.1)


@pytest.mark.parametrize(("gap", "levels"), [(2.0, 1), (3.5, 2)])
def test_levels_are_further_apart_than_thrice_what_each_wanders(gap: float, levels: int) -> None:
    """Strokes within 1 kPa of each other about 20 kPa, ten at each, both ways; the top level is 100 kPa."""
    own = np.linspace(20.0, 21.0, 10)
    medians = 1e3 * np.concatenate([own, own + 1.0 + gap, np.full(10, 100.0)])
    label = np.repeat([0, 0, 1], 10)
    branch = np.tile([UNLOADING, LOADING], 15)
    found = part_close(medians, np.zeros(30), branch, label, 0.0)
    assert np.unique(found[:20]).tolist() == list(range(levels))
    assert np.all(found[20:] == levels)
