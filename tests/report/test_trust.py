"""Each check fires where it should, keeps quiet where it should, and moves the verdict."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mpam_calib.report import trust
from mpam_calib.report.numbers import significant
from mpam_calib.report.view import CalibrationView

from .synthetic import material, muscle


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    """A muscle with nothing wrong but an unidentified dead-band."""
    return muscle(n_draws=400)


def settled(view: CalibrationView, **changes: object) -> CalibrationView:
    return replace(view, convergence=replace(view.convergence, **changes))


def test_a_sound_calibration_is_trusted_and_its_limit_named(sound: CalibrationView) -> None:
    verdict = trust.assess(sound)
    assert verdict.level == "good"
    assert verdict.sentence.startswith("Yes")
    assert "P_DB_kPa" in verdict.sentence
    assert "the sampler has settled" in verdict.reasons[-1]


def test_nothing_to_remark(sound: CalibrationView) -> None:
    identified = sound.unidentified.assign(contraction=0.9)
    verdict = trust.assess(replace(sound, unidentified=identified))
    assert verdict.sentence == "Yes: you can use these numbers with their bands."
    assert len(verdict.reasons) == 1


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rhat_max": 1.011, "rhat_parameter": "K_f"}, "K_f"),
        ({"ess_bulk_min": 399.0}, "399"),
        ({"ess_tail_min": 12.0}, "12"),
        ({"converged": False}, "budget"),
        ({"rhat_max": float("nan")}, "R-hat"),
        ({"ess_tail_min": float("nan")}, "independent"),
    ],
)
def test_an_unsettled_sampler_is_bad(sound: CalibrationView, changes: dict[str, object], words: str) -> None:
    verdict = trust.assess(settled(sound, **changes))
    assert verdict.level == "bad"
    assert verdict.sentence.startswith("No")
    assert words in verdict.reasons[0]
    assert "the sampler has settled" not in verdict.reasons[-1]


def test_the_limits_themselves_pass(sound: CalibrationView) -> None:
    assert trust.convergence(settled(sound, rhat_max=1.01, ess_bulk_min=400.0, ess_tail_min=400.0)) is None


def test_separate_explanations_are_a_caution(sound: CalibrationView) -> None:
    limit = trust.convergence(settled(sound, modes=2))
    assert limit is not None
    assert limit.level == "caution"
    assert "2 separate" in limit.sentence


@pytest.mark.parametrize(
    ("remainder", "noise", "level"),
    [
        (0.24, 0.25, None),  # within the noise
        (0.30, 0.25, None),  # above it, but nothing beside 94 N
        (1.2, 0.25, "good"),
        (3.0, 0.25, "caution"),
        (12.0, 0.25, "bad"),
        (3.0, 4.0, None),
        (float("nan"), 0.25, None),
    ],
)
def test_remainder(sound: CalibrationView, remainder: float, noise: float, level: str | None) -> None:
    limit = trust.remainder(replace(sound, remainder=remainder, noise=noise))
    assert (limit.level if limit else None) == level
    if limit:
        assert f"wrong by about {significant(remainder, 2)} N" in limit.sentence


def test_a_bad_fit_asks_what_the_reader_asked(sound: CalibrationView) -> None:
    """Units that are odd stand on the first screen; readings that were left out are no reason."""
    odd = "loops: forces up to 9 N, while the gas alone pulls about 90 N; are the units right?"
    warned = replace(sound, warnings=["loops: 4 readings at turns are left out", odd])
    assert trust.remainder(replace(warned, remainder=3.0)).sentence.find("data first") < 0
    sentence = trust.remainder(replace(warned, remainder=30.0)).sentence
    assert sentence.endswith(f"look at the data first: {odd}")


@pytest.mark.parametrize(("shift", "told"), [(0.0, False), (1.0, False), (3.0, True)])
def test_readings_near_full_length(sound: CalibrationView, shift: float, told: bool) -> None:
    """Readings that are off, by so many sds of their bands, where the blocked force is read."""
    observed = sound.observed.copy()
    sd = 0.5 + 0.004 * observed["pressure_kPa"]
    observed["force_N"] += shift * sd * np.exp(-((observed["contraction"] / 0.02) ** 4))
    limit = trust.full_length(replace(sound, observed=observed))
    assert (limit is not None) == told
    if limit is not None:
        assert limit.level == "caution"
        assert "near full length" in limit.sentence


def test_few_readings_near_full_length_say_nothing(sound: CalibrationView) -> None:
    observed = sound.observed[sound.observed["contraction"] > trust.NEAR]
    verdict = trust.assess(replace(sound, observed=observed))
    assert trust.held_near(replace(sound, observed=observed)) is None
    assert not any("full length" in reason for reason in verdict.reasons)


def test_an_unassessed_remainder_is_no_good_news(sound: CalibrationView) -> None:
    verdict = trust.assess(replace(sound, remainder=float("nan")))
    assert not any("noise" in reason for reason in verdict.reasons)


@pytest.mark.parametrize(("factor", "level"), [(1.0, None), (8.0, "caution"), (20.0, "bad")])
def test_wide_bands(sound: CalibrationView, factor: float, level: str | None) -> None:
    bands = sound.bands.copy()
    rows = bands["quantity"] == "blocked_force_N"
    for q in ("q05", "q95"):
        bands.loc[rows, q] = bands.loc[rows, "mean"] + factor * (bands.loc[rows, q] - bands.loc[rows, "mean"])
    limit = trust.band_width(replace(sound, bands=bands))
    assert (limit.level if limit else None) == level
    if limit:
        assert "blocked force" in limit.sentence


def test_extrapolation_at_the_top_level_only(sound: CalibrationView) -> None:
    bands = sound.bands.copy()
    free = bands["quantity"] == "free_contraction"
    bands.loc[free & (bands["pressure_kPa"] == 50.0), "extrapolated"] = True
    assert trust.extrapolation(replace(sound, bands=bands)) is None
    bands.loc[free, "extrapolated"] = True
    limit = trust.extrapolation(replace(sound, bands=bands))
    assert limit is not None
    assert limit.level == "caution"
    assert "free contraction at 250 kPa" in limit.sentence


def left_out_levels(inside: tuple[float, ...], readings: int = 200) -> pd.DataFrame:
    outer = [True, *[False] * (len(inside) - 2), True]
    return pd.DataFrame({"inside90": inside, "readings": readings, "extrapolated": outer})


@pytest.mark.parametrize(
    ("inside", "between", "beyond"),
    [
        ((0.9, 0.9, 0.9, 0.9), None, None),
        ((0.2, 0.9, 0.9, 0.9), None, "good"),
        ((0.9, 0.9, 0.5, 0.9), "caution", None),
        ((0.0, 0.1, 0.0, 0.1), "caution", "good"),
    ],
)
def test_levels_that_the_others_do_not_foresee(
    sound: CalibrationView, inside: tuple[float, ...], between: str | None, beyond: str | None
) -> None:
    left_out = left_out_levels(inside)
    view = replace(sound, left_out=left_out)
    limits = (trust.between_levels(view), trust.beyond_levels(view))
    assert tuple(limit.level if limit else None for limit in limits) == (between, beyond)
    if limits[0]:
        assert f"{100 * (inside[1] + inside[2]) / 2:.0f} % of its readings" in limits[0].sentence


def test_levels_that_could_not_be_left_out_are_no_good_news(sound: CalibrationView) -> None:
    told = ("inner levels lie", "recorded pressures")
    assert not any(words in reason for reason in trust.assess(sound).reasons for words in told)
    reasons = trust.assess(replace(sound, left_out=left_out_levels((0.9, 0.9, 0.9)))).reasons
    few = trust.assess(replace(sound, left_out=left_out_levels((0.5, 0.5, 0.5), readings=9)))
    assert few.reasons == trust.assess(sound).reasons
    assert "the inner levels lie in the bands that the others give" in reasons[-1]


def test_a_gauge_that_makes_up_the_band_is_named(sound: CalibrationView) -> None:
    assert trust.gauge(sound) is None
    assert trust.gauge(replace(sound, pressure_bias_sd_kPa=0.1)) is None
    limit = trust.gauge(replace(sound, pressure_bias_sd_kPa=22.5))
    assert limit is not None
    # 22.5 kPa at 0.39 N/kPa, 90 %: 14 N
    assert "± 14 N" in limit.sentence
    assert limit.level == "good"
    assert "as this gauge reads them" in limit.sentence  # the band is far narrower: it cannot be what sets it
    limit = trust.gauge(replace(sound, pressure_bias_sd_kPa=5.0))
    assert limit is not None and "sets the width" in limit.sentence


def test_reconstructed_data_are_a_caution(sound: CalibrationView) -> None:
    verdict = trust.assess(replace(sound, provenance="These loops are reconstructed from tables."))
    assert verdict.level == "caution"
    assert "reconstructed" in verdict.sentence
    assert trust.source(replace(sound, provenance="Digitised from a figure.")) is None


def test_the_worst_limit_comes_first(sound: CalibrationView) -> None:
    view = replace(settled(sound, converged=False), remainder=3.0, provenance="reconstructed")
    verdict = trust.assess(view)
    assert verdict.level == "bad"
    assert verdict.reasons[0].startswith("The sampler has not settled")
    assert any("wrong by about 3.0 N" in reason for reason in verdict.reasons)


def test_a_material_is_judged_on_its_stress() -> None:
    view = material(n_draws=400)
    assert trust.assess(view).level == "good"
    assert trust.headline_bands(view)[0][1] == pytest.approx(213e3, rel=0.01)
    limit = trust.remainder(replace(view, remainder=3e4))
    assert limit is not None
    assert limit.level == "bad"
    assert " Pa " in limit.sentence
