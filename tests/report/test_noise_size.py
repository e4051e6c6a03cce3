"""Fitted noise against what is known of it: misfit in it is told, ordinary noise is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from model import build
from prediction.coverage import as_specimen, rig_case

from mpam_calib.calibration import calibrate
from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.noise import correlated_noise_parameters, white_noise_parameter
from mpam_calib.report import noise_size
from mpam_calib.report.calibration import calibration_page
from mpam_calib.report.limit import Limit
from mpam_calib.report.trust import assess
from mpam_calib.report.view import CalibrationView
from mpam_calib.run.view import view_of

from .synthetic import muscle
from .test_calibration_page import words_of


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    return muscle(n_draws=400)


def noisy(
    view: CalibrationView, fitted: float, reading: float | None, declared: float | None = None
) -> CalibrationView:
    summary = view.summary.copy()
    summary.loc[summary["parameter"] == "noise_sd_N", "mean"] = fitted
    known = (float("nan") if value is None else value for value in (reading, declared))
    return replace(view, summary=summary, reading_noise=next(known), declared_noise=next(known))


@pytest.mark.parametrize(
    ("fitted", "reading", "declared", "level"),
    [
        (0.25, 0.25, 0.25, None),
        (2.0, 0.8, 0.8, None),
        (3.0, 0.8, None, "caution"),
        (3.0, 0.2, None, "caution"),  # fifteen times, but little beside 94 N
        (9.0, 0.8, None, "bad"),
        (7.0, 0.8, None, "caution"),  # nine times
        (0.3, 0.01, 0.01, None),  # not worth a word beside 94 N
        (9.0, None, 0.8, "bad"),
        (9.0, None, None, None),
        (2.0, 1.9, 0.5, "caution"),  # noise indeed, but not what was declared
    ],
)
def test_noise_against_what_is_known(
    sound: CalibrationView, fitted: float, reading: float | None, declared: float | None, level: str | None
) -> None:
    view = noisy(sound, fitted, reading, declared)
    limit = noise_size.noise_size(view)
    assert (limit.level if limit else None) == level


PRAISE = "the noise of a reading is at most 3 times the declared one"


@pytest.mark.parametrize(
    ("white", "whole", "reading", "declared", "praised", "told"),
    [
        (0.25, 0.3, 0.25, 0.25, True, False),
        (0.018, 1.5, 0.02, 0.25, False, True),  # a hum, which white noise knows nothing of
        (0.018, 1.5, 0.02, None, False, False),  # nothing to compare it with
        (0.3, 0.3, 0.002, None, False, False),  # small beside the force, but never compared
        (0.3, 0.3, 0.25, 0.01, False, False),  # compared, and far off, if not worth a word
        (3.0, 3.0, 2.9, 0.25, False, False),  # noise that another check tells
    ],
)
def test_the_whole_noise_is_compared_with_the_declared_one(
    sound: CalibrationView,
    white: float,
    whole: float,
    reading: float,
    declared: float | None,
    praised: bool,
    told: bool,
) -> None:
    view = replace(noisy(sound, white, reading, declared), noise=whole)
    limit = noise_size.lasting_noise(view)
    assert (limit is not None) == told
    reasons = " ".join(assess(view).reasons)
    assert (PRAISE in reasons) == praised
    if limit is not None:
        assert limit.level == "good"
        assert limit.brief == "a reading's noise is 1.5 N, against the declared force_sd_N = 0.25"
        assert limit.sentence in reasons and "fits to within the noise" not in reasons


def test_white_noise_and_noise_that_lasts_are_told_apart() -> None:
    """By their names in the table, which must not call either of them the sensor's noise alone."""
    setting = draw_blueprint(build.specimen({}, build.loops())).setting()
    assert setting is not None
    white, lasting = white_noise_parameter(setting), correlated_noise_parameters(setting, 60.0, 0.1)[0]
    assert white.meaning == "white noise, new in every reading, one sigma"
    assert lasting.meaning == "noise that lasts over several readings, one sigma"


@pytest.mark.parametrize(("lasting", "told"), [(0.25, False), (4.0, False), (9.0, True)])
def test_noise_that_lasts_is_ordinary_unless_it_is_huge(
    sound: CalibrationView, lasting: float, told: bool
) -> None:
    limit = noise_size.noise_size(replace(noisy(sound, 0.25, 0.25), noise=lasting))
    assert (limit is not None) == told
    if limit is not None:
        assert limit.level == "caution" and "9.0 N against 0.25 N" in limit.brief


def test_the_card_calls_the_whole_noise_that_of_a_reading(sound: CalibrationView) -> None:
    words = words_of(calibration_page(replace(sound, noise=1.5)).render())
    assert "noise of a reading: 1.5 N" in words
    assert "sensor noise" not in words


def test_what_is_said(sound: CalibrationView) -> None:
    limit = noise_size.noise_size(noisy(sound, 46.0, 0.85, 0.8))
    assert limit is not None
    told = "what the simulation misses went into the noise: 46 N against 0.85 N from reading to reading"
    assert limit.brief == told
    limit = noise_size.noise_size(noisy(sound, 46.0, None, 0.8))
    assert limit is not None and limit.brief.endswith("against the declared force_sd_N = 0.8")
    assert "went into the noise" not in limit.brief  # a declaration may be wrong as well
    assert "Either the load cell is noisier than declared" in limit.sentence
    limit = noise_size.noise_size(noisy(sound, 2.0, 1.9, 0.5))
    assert limit is not None and limit.brief == "the load cell is noisier than declared"


def found_in(force: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Limit | None:
    """What is said of a rig's test whose readings (n,) are made of its true force and row's level (n,)."""
    muscle_, rows, true, _, protocol = rig_case(0)
    level = rows.level.astype(np.int64)
    specimen = as_specimen(muscle_, rows, force(true, level), protocol)
    return noise_size.noise_size(view_of(done := calibrate(specimen), done.bands()))


@pytest.mark.long
def test_slow_noise_is_ordinary() -> None:
    rng = np.random.default_rng(4)

    def slow(true: np.ndarray, level: np.ndarray) -> np.ndarray:
        white = 0.002 * true.max() * rng.standard_normal(len(true))
        lasting = np.zeros(len(true))
        for i in range(1, len(true)):
            lasting[i] = 0.9 * lasting[i - 1] + 0.436 * rng.standard_normal()
        return true + white + 0.02 * true.max() * lasting

    assert found_in(slow) is None


def test_strokes_of_mixed_levels_are_not_ordinary() -> None:
    rng = np.random.default_rng(4)

    def mixed(true: np.ndarray, level: np.ndarray) -> np.ndarray:
        white = 0.002 * true.max() * rng.standard_normal(len(true))
        return true * np.where(np.arange(len(true)) // 8 % 2, 1.5, 0.5) + white

    limit = found_in(mixed)
    assert limit is not None and "went into the noise" in limit.brief


@pytest.mark.parametrize("kind", ["loops", "force_map", "blocked_force"])
def test_the_largest_pull_is_that_of_whatever_was_recorded(sound: CalibrationView, kind: str) -> None:
    """But for slack readings, and for one wild one in a thousand."""
    force = np.append(np.linspace(-5.0, 80.0, 999), 1e4)
    row = {"kind": kind, "force_N": force, "censored": False}
    slack = pd.DataFrame({"kind": kind, "force_N": np.full(500, 99.0), "censored": True})
    view = replace(sound, observed=pd.concat([pd.DataFrame(row), slack]))
    assert noise_size.top_force(view) == pytest.approx(79.2, abs=0.2)
