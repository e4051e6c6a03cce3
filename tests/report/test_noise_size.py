"""Fitted noise against what is known of it: misfit in it is told, ordinary noise is not."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from prediction.coverage import as_specimen, rig_case

from mpam_calib.calibration import calibrate
from mpam_calib.report import noise_size
from mpam_calib.report.limit import Limit
from mpam_calib.report.view import CalibrationView
from mpam_calib.run.view import view_of

from .synthetic import muscle


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
    assert noise_size.noise_known(view) == (reading is not None or declared is not None)


@pytest.mark.parametrize(("lasting", "told"), [(0.25, False), (4.0, False), (9.0, True)])
def test_noise_that_lasts_is_ordinary_unless_it_is_huge(
    sound: CalibrationView, lasting: float, told: bool
) -> None:
    limit = noise_size.noise_size(replace(noisy(sound, 0.25, 0.25), noise=lasting))
    assert (limit is not None) == told
    if limit is not None:
        assert limit.level == "caution" and "9.0 N against 0.25 N" in limit.brief


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


def test_slow_noise_is_ordinary_and_strokes_of_mixed_levels_are_not() -> None:
    rng = np.random.default_rng(4)

    def slow(true: np.ndarray, level: np.ndarray) -> np.ndarray:
        white = 0.002 * true.max() * rng.standard_normal(len(true))
        lasting = np.zeros(len(true))
        for i in range(1, len(true)):
            lasting[i] = 0.9 * lasting[i - 1] + 0.436 * rng.standard_normal()
        return true + white + 0.02 * true.max() * lasting

    assert found_in(slow) is None

    def mixed(true: np.ndarray, level: np.ndarray) -> np.ndarray:
        white = 0.002 * true.max() * rng.standard_normal(len(true))
        return true * np.where(np.arange(len(true)) // 8 % 2, 1.5, 0.5) + white

    limit = found_in(mixed)
    assert limit is not None and "went into the noise" in limit.brief
