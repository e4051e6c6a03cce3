"""Measured free contractions beside the curve: contradictions are told, scatter about it is not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mpam_calib.report.free_read import early_roots, free_read
from mpam_calib.report.trust import assess
from mpam_calib.report.view import CalibrationView

from .synthetic import LEVELS, muscle

PRAISE = ("the readings lie in their bands", "the simulation fits to within the noise or half a per cent")


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    return muscle(n_draws=400)


def read(view: CalibrationView, *misses: float, censored: bool = False) -> CalibrationView:
    """Free contractions that miss the curve by so much, at as many pressures up to 250 kPa."""
    pressure = np.linspace(250.0, 50.0, len(misses))
    curve = 0.34 * (1 - np.exp(-pressure / 60))
    nearest = np.abs(pressure[:, None] - np.array(LEVELS)).argmin(axis=1)
    rows = pd.DataFrame(
        {
            "kind": "free_contraction", "level_kPa": np.array(LEVELS)[nearest], "pressure_kPa": pressure,
            "contraction": curve + misses, "low_N": curve - 0.002, "high_N": curve + 0.002,
            "censored": censored,
        }
    )  # fmt: skip
    return replace(view, observed=pd.concat([view.observed, rows]))


@pytest.mark.parametrize(
    ("misses", "told"),
    [
        ((-0.08,) * 9, True),
        ((0.08,) * 9, True),
        ((-0.015,), True),
        ((0.015, 0.0, -0.015), True),  # another slope in pressure
        ((0.005,) * 9, False),  # less than 3 %
        ((0.0015,), False),  # in the band
        ((), False),
    ],
)
def test_free_contractions_that_the_curve_misses_are_told(
    sound: CalibrationView, misses: tuple[float, ...], told: bool
) -> None:
    view = read(sound, *misses)
    limit = free_read(view)
    verdict = assess(view)
    assert (limit is not None) == told
    assert (verdict.level == "caution") == told
    for words in PRAISE:
        assert (words in verdict.reasons[-1]) != told
    if limit is not None:
        assert limit.sentence in verdict.reasons and limit.brief in verdict.sentence


def test_both_values_stand_side_by_side_where_they_differ_most(sound: CalibrationView) -> None:
    limit = free_read(read(sound, -0.09, -0.05, -0.05))
    assert limit is not None
    # 0.34 (1 − exp(−250/60)) = 0.3347
    assert limit.brief == "the measured free contractions (24.5 % at 250 kPa) contradict the curve (33.5 %)"
    assert "at 250 kPa 24.5 % was measured, and the curve has 33.5 %" in limit.sentence


def test_a_curve_that_still_pulls_at_its_end_has_no_value_there(sound: CalibrationView) -> None:
    view = read(sound, -0.09)
    top = float(view.readings("free_contraction")["high_N"].iloc[0])
    limit = free_read(replace(view, curves_end=top))
    assert limit is not None and limit.brief.endswith("contradict the curve (at least 33.5 %)")


def test_readings_that_scatter_about_the_curve_do_not_contradict_it(sound: CalibrationView) -> None:
    """A ruler's noise of 0.02, and the same readings all too small by more than it."""
    noise = 0.02 * np.random.default_rng(3).standard_normal(12)
    assert free_read(read(sound, *noise)) is None
    assert free_read(read(sound, *(noise - 0.08))) is not None


def test_what_never_pulled_has_no_free_contraction_to_compare(sound: CalibrationView) -> None:
    assert free_read(read(sound, *(-0.08,) * 9, censored=True)) is None


def test_draws_that_end_short_of_a_measured_free_contraction_are_a_caution(sound: CalibrationView) -> None:
    assert early_roots(sound) is None
    verdict = assess(replace(sound, early_roots=0.6))
    assert verdict.level == "caution"
    assert verdict.sentence.endswith("the simulation contradicts a measured free contraction.")
    assert verdict.reasons[0].startswith("In 60 % of the draws the force is gone well short")
