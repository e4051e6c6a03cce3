"""A gauge's offset: as wide as declared where nothing was learnt of it, a known amount once it is found."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from mpam_calib.report.gauge import gauge
from mpam_calib.report.numbers import significant
from mpam_calib.report.view import CalibrationView

from .synthetic import muscle

DECLARED_KPA = 22.5
SLOPE = 0.39
"""N/kPa, of the made-up muscle's blocked force."""


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    return replace(muscle(n_draws=400), pressure_bias_sd_kPa=DECLARED_KPA)


def sd_as_wide_as_the_band(view: CalibrationView) -> float:
    """The sd (kPa) of an offset that by itself makes the blocked force's band as wide as it is."""
    rows = view.quantity("blocked_force_N")
    half = float(rows["q95"].iloc[-1] - rows["q05"].iloc[-1]) / 2.0
    return half / (1.645 * SLOPE)


def sampled(view: CalibrationView, mean: float, sd: float) -> CalibrationView:
    """The view of a run that has sampled the offset (true pressure minus reading, kPa)."""
    row = {"parameter": "pressure_bias_kPa", "unit": "kPa", "mean": mean, "sd": sd, "q50": mean}
    row |= {"q05": mean - 1.645 * sd, "q95": mean + 1.645 * sd, "prior_sd": DECLARED_KPA}
    return replace(view, summary=pd.concat([view.summary, pd.DataFrame([row])], ignore_index=True))


@pytest.mark.parametrize(
    ("mean", "reads", "newtons"),
    [(-14.97, "14.97 kPa too much", "5.8 N higher"), (14.97, "14.97 kPa too little", "5.8 N lower")],
)
def test_an_offset_that_the_fit_found_is_told_with_what_it_does(
    sound: CalibrationView, mean: float, reads: str, newtons: str
) -> None:
    """Where a gauge reads 15 kPa too much, a true one at the same number has 15 kPa more to pull with."""
    limit = gauge(sampled(sound, mean, 0.12))
    assert limit is not None and limit.level == "good"
    assert f"By the fit it reads {reads} (90 % band 14.77–15.17 kPa)" in limit.sentence
    assert f"the blocked force at the top level is about {newtons}" in limit.sentence
    assert "may differ" not in limit.sentence and "dead-band" in limit.sentence
    assert limit.brief == "the bands hold for pressures as this gauge reads them"


def test_a_found_offset_that_hardly_matters_is_not_told(sound: CalibrationView) -> None:
    assert gauge(sampled(sound, 0.02, 0.005)) is None
    assert gauge(sampled(sound, 0.0, 0.1)) is None


def test_one_that_was_not_learnt_is_open_by_what_the_fit_leaves_of_it(sound: CalibrationView) -> None:
    limit = gauge(sampled(sound, 0.0, 20.0))
    # 20 kPa at 0.39 N/kPa, 90 %: 13 N
    assert limit is not None and "may differ by ± 13 N (90 %" in limit.sentence
    limit = gauge(sampled(sound, -12.0, 20.0))
    # 0.39 N/kPa at 12 ± 33 kPa, the curve a little steeper there
    assert limit is not None and "may differ by −8.2 to 18 N (90 %" in limit.sentence


def test_one_that_sets_the_width_does_so_by_what_the_fit_leaves_of_it(sound: CalibrationView) -> None:
    sd = sd_as_wide_as_the_band(sound)
    limit = gauge(sampled(replace(sound, pressure_bias_sd_kPa=1.2 * sd), 0.0, sd))
    assert limit is not None and "sets the width" in limit.sentence


@pytest.mark.parametrize(("declared", "sets"), [(2.1, False), (1.9, True)])
def test_an_offset_about_zero_that_the_readings_told_is_narrowed_by_more_of_them(
    sound: CalibrationView, declared: float, sets: bool
) -> None:
    """The fit leaves a little less than half of the declared sd, or a little more."""
    sd = sd_as_wide_as_the_band(sound)
    limit = gauge(sampled(replace(sound, pressure_bias_sd_kPa=declared * sd), 0.0, sd))
    assert limit is not None and limit.level == "good"
    assert ("sets the width" in limit.brief) == ("More loops do not help" in limit.sentence) == sets
    assert limit.brief.endswith("kPa only") == ("more readings narrow it" in limit.sentence) != sets
    if not sets:
        # 1.645 sds of it are worth half the band.
        assert f"is known to ± {significant(1.645 * sd, 2)} kPa (90 %)" in limit.sentence


def test_one_that_they_told_too_well_to_matter_is_not_told(sound: CalibrationView) -> None:
    for share, told in ((0.4, False), (0.7, True)):
        assert (gauge(sampled(sound, 0.0, share * sd_as_wide_as_the_band(sound))) is not None) == told


def test_one_level_tells_the_slope_of_a_line_through_zero(sound: CalibrationView) -> None:
    """(250 − 9) 0.39 N at 250 kPa: 0.376 N/kPa, beside 0.39 between two levels."""
    one = replace(sound, bands=sound.bands[sound.bands["pressure_kPa"] == 250.0], levels_kPa=(250.0,))
    for view, newtons in ((sound, 0.39), (one, 241.0 / 250.0 * 0.39)):
        limit = gauge(sampled(view, -15.0, 0.12))
        assert limit is not None
        assert f"is about {significant(15.0 * newtons, 2)} N higher" in limit.sentence
