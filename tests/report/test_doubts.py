"""Data to be doubted first: slack that the fit does not believe, wandering levels, stray readings."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from model import build

from mpam_calib.report import doubts
from mpam_calib.report.view import CalibrationView
from mpam_calib.specimen.oddities import level_stray, stroke_stray

from .synthetic import muscle


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    return muscle(n_draws=400)


def with_slack(
    view: CalibrationView, pull: float, kind: str = "force_map", floor: float = 0.0
) -> CalibrationView:
    """One more reading, at 100 kPa, that is said to be slack where the fit pulls so hard (N)."""
    row = {"kind": kind, "level_kPa": 100.0, "pressure_kPa": 100.0, "contraction": 0.0, "branch": ""}
    foreseen = {"fitted_N": pull, "low_N": pull - 1.5, "high_N": pull + 1.5}
    slack = pd.DataFrame([row | foreseen | {"force_N": floor, "censored": True}])
    return replace(view, observed=pd.concat([view.observed, slack]))


@pytest.mark.parametrize("kind", ["force_map", "blocked_force"])
def test_slack_where_the_fit_pulls(sound: CalibrationView, kind: str) -> None:
    limit = doubts.overruled_slack(with_slack(sound, 35.0, kind))
    assert limit is not None and limit.level == "caution"
    assert limit.brief == "1 slack reading, at 100 kPa, is not believed"
    assert "up to 35 N" in limit.sentence


@pytest.mark.parametrize(("kind", "said"), [("force_map", "at 100 kPa"), ("blocked_force", "at 88 kPa")])
def test_slack_is_found_by_its_level_or_where_there_is_none_by_its_pressure(
    sound: CalibrationView, kind: str, said: str
) -> None:
    view = with_slack(sound, 35.0, kind)
    observed = view.observed.copy()
    observed.loc[observed["censored"].astype(bool), "pressure_kPa"] = 88.0
    limit = doubts.overruled_slack(replace(view, observed=observed))
    assert limit is not None and limit.brief == f"1 slack reading, {said}, is not believed"


@pytest.mark.parametrize(
    ("pull", "floor"),
    # past the free contraction, just before it, a floor that high, and where nothing is foreseen
    [(-20.0, 0.0), (2.0, 0.0), (35.0, 35.0), (float("nan"), 0.0)],
)
def test_slack_that_is_believed(sound: CalibrationView, pull: float, floor: float) -> None:
    assert doubts.overruled_slack(with_slack(sound, pull, floor=floor)) is None
    assert doubts.overruled_slack(sound) is None


def test_slack_is_judged_by_the_noise_of_a_reading(sound: CalibrationView) -> None:
    """The band of a mean of many is narrow; some of its readings may be above the floor all the same."""
    slack = with_slack(sound, 6.0)
    assert doubts.overruled_slack(replace(slack, reading_noise=0.1)) is not None
    assert doubts.overruled_slack(replace(slack, reading_noise=2.0)) is None


@pytest.mark.parametrize(
    ("level", "stray", "told"),
    [
        (100.0, 60.0, True),
        (100.0, 15.0, False),
        (1.0, 3.0, False),  # a gauge's noise at a level near zero
    ],
)
def test_a_level_that_wanders(sound: CalibrationView, level: float, stray: float, told: bool) -> None:
    levels = (level, *sound.levels_kPa[1:])
    limit = doubts.wandering(
        replace(sound, levels_kPa=levels, strays_kPa=(stray, *(0.0 for _ in levels[1:])))
    )
    assert (limit is not None) == told
    if limit is not None:
        assert limit.level == "bad"
        assert limit.brief == "strokes at the level 100 kPa stray from it by up to 60 kPa"


def test_how_far_readings_stray_from_their_level() -> None:
    loops = build.loops()
    levels = build.specimen({}, loops).levels_Pa
    assert level_stray(loops, levels, 1) == pytest.approx(0.0, abs=1e-6)
    mixed = replace(loops, pressure_Pa=loops.pressure_Pa * (1.0 + 0.6 * (loops.stroke % 2)))
    assert level_stray(mixed, levels, 1) == pytest.approx(0.6 * levels[1])
    changed = replace(mixed, branch=2 * mixed.branch)  # pressurised on purpose
    assert level_stray(changed, levels, 1) == 0.0


def test_a_stroke_strays_as_a_whole() -> None:
    """Neither a gauge's noise nor a pressure that moves within the strokes makes them another level's."""
    loops = build.loops(rows=60, cycles=2)
    levels = build.specimen({}, loops).levels_Pa
    noise = np.random.default_rng(3).standard_normal(len(loops.force_N))
    for wandering in (0.25 * np.sin(1e3 * loops.displacement_m), 0.1 * noise):
        stray = replace(loops, pressure_Pa=loops.pressure_Pa * (1.0 + wandering))
        own = build.specimen({}, stray).levels_Pa
        assert stroke_stray(stray, own, 1) < 0.05 * levels[1] < level_stray(stray, own, 1)
    mixed = replace(loops, pressure_Pa=loops.pressure_Pa * (1.0 + 0.6 * (loops.stroke % 4 == 0)))
    assert stroke_stray(mixed, levels, 1) == pytest.approx(0.6 * levels[1])
    assert stroke_stray(replace(mixed, branch=2 * mixed.branch), levels, 1) == 0.0


def test_what_check_asks_is_repeated_where_the_verdict_is_no_yes(sound: CalibrationView) -> None:
    """Readings that were left out are no doubt; units only where nothing fits."""
    stray = "loops: a force is far from all others (1e+05 N at 3 s)"
    units = "loops: forces up to 9 N, while the gas alone pulls about 90 N; are the units right?"
    warned = replace(sound, warnings=["loops: 4 readings at turns are left out", stray, units])
    assert doubts.look_first(warned, "good") == ""
    assert doubts.look_first(warned, "caution") == f"Look at the data first: {stray}"
    assert doubts.look_first(warned, "bad") == f"Look at the data first: {stray}; {units}"
    assert doubts.look_first(sound, "bad") == ""
