"""Bands that hold their readings, and bands that do not: what is said of either."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mpam_calib.report import held
from mpam_calib.report.trust import assess
from mpam_calib.report.view import CalibrationView

from .synthetic import muscle


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    return muscle(n_draws=400)


def off(view: CalibrationView, sds: float) -> CalibrationView:
    """Readings that lie, on every second place of the stroke, so many sds of their bands off."""
    observed = view.observed.copy()
    sd = 0.5 + 0.004 * observed["pressure_kPa"]
    observed["force_N"] += sds * sd * (np.arange(len(observed)) % 2)
    return replace(view, observed=observed)


@pytest.mark.parametrize(("sds", "told"), [(0.0, False), (0.5, False), (3.0, True)])
def test_readings_anywhere_along_the_stroke(sound: CalibrationView, sds: float, told: bool) -> None:
    view = off(sound, sds)
    limit = held.along_stroke(view)
    assert (limit is not None) == told
    praise = "the readings lie in their bands" in assess(view).reasons[-1]
    assert praise != told
    if limit is not None:
        found = held.held_along(view)
        assert found is not None and 0.4 < found.share < 0.6
        assert limit.level == "caution"
        words = f"the bands hold {100 * found.share:.0f} % of their readings"
        assert limit.brief == f"at the recorded pressures {words}"
        assert "Run diagnose" in limit.sentence


@pytest.mark.parametrize("effect", ["stress_softening", "creep:wall"])
def test_readings_of_a_declared_history_are_not_those_of_a_settled_muscle(
    sound: CalibrationView, effect: str
) -> None:
    softens = sound.simulation.model_copy(update={"effects": (effect,)})
    view = replace(off(sound, 3.0), simulation=softens)
    assert held.held_along(view) is None and held.along_stroke(view) is None
    assert not any("readings lie in" in reason for reason in assess(view).reasons)


def test_readings_past_the_band_say_nothing(sound: CalibrationView) -> None:
    """A band ends at the free contraction; what the readings do further on is not in it."""
    last = sound.observed[sound.observed["kind"] == "loops"].assign(contraction=0.5, force_N=-50.0)
    view = replace(sound, observed=pd.concat([sound.observed, last]))
    assert held.held_along(view) == held.held_along(sound)
    # At 50 kPa it ends at 0.192 already, whatever the others do.
    low = last[last["level_kPa"] == 50.0].assign(contraction=0.25)
    view = replace(sound, observed=pd.concat([sound.observed, low]))
    assert held.held_along(view) == held.held_along(sound)


def test_slack_readings_lie_in_no_band(sound: CalibrationView) -> None:
    """They read the floor, wherever the muscle would pull."""
    slack = sound.observed[sound.observed["kind"] == "loops"].assign(force_N=-50.0, censored=True)
    view = replace(sound, observed=pd.concat([sound.observed, slack]))
    assert held.held_along(view) == held.held_along(sound)
    assert held.held_near(view) == held.held_near(sound)


@pytest.mark.parametrize(("sds", "told"), [(0.0, True), (3.0, False)])
def test_recorded_pressures_are_recommended_only_where_they_are_held(
    sound: CalibrationView, sds: float, told: bool
) -> None:
    view = replace(off(sound, sds), left_out=left_out_levels((0.9, 0.1, 0.1, 0.9)))
    limit = held.between_levels(view)
    assert limit is not None and limit.level == "caution"
    assert ("at the recorded pressures only" in limit.sentence) == told
    assert ("Do not interpolate" in limit.sentence) != told


@pytest.mark.parametrize(("shift", "told"), [(0.0, False), (1.0, False), (3.0, True)])
def test_readings_near_full_length(sound: CalibrationView, shift: float, told: bool) -> None:
    """Readings that are off, by so many sds of their bands, where the blocked force is read."""
    observed = sound.observed.copy()
    sd = 0.5 + 0.004 * observed["pressure_kPa"]
    observed["force_N"] += shift * sd * np.exp(-((observed["contraction"] / 0.02) ** 4))
    limit = held.full_length(replace(sound, observed=observed))
    assert (limit is not None) == told
    if limit is not None:
        assert limit.level == "caution"
        assert "near full length" in limit.sentence


def test_few_readings_near_full_length_say_nothing(sound: CalibrationView) -> None:
    observed = sound.observed[sound.observed["contraction"] > held.NEAR]
    verdict = assess(replace(sound, observed=observed))
    assert held.held_near(replace(sound, observed=observed)) is None
    assert not any("full length" in reason for reason in verdict.reasons)


def kept(view: CalibrationView, readings: int, inside: int) -> CalibrationView:
    """So few readings, at full length, of which so many lie in their bands."""
    observed = view.observed[view.observed["kind"] == "loops"].iloc[:readings].assign(contraction=0.0)
    observed["force_N"] = observed["fitted_N"] + 99.0 * (np.arange(readings) >= inside)
    return replace(view, observed=observed)


@pytest.mark.parametrize(
    ("readings", "inside", "told"),
    [(20, 15, False), (20, 13, True), (200, 155, True), (200, 165, False)],
)
def test_a_share_that_is_low_by_chance_is_neither_alarm_nor_praise(
    sound: CalibrationView, readings: int, inside: int, told: bool
) -> None:
    """Of twenty readings fifteen or less lie in 90 % bands by chance in one case of 23."""
    view = kept(sound, readings, inside)
    assert (held.full_length(view) is not None) == told
    assert (held.along_stroke(view) is not None) == told
    praised = "near full length lie in" in assess(view).reasons[-1]
    assert praised == (inside / readings >= held.HELD)


def test_a_reading_is_compared_with_the_band_at_its_own_pressure(sound: CalibrationView) -> None:
    """A regulator that is slow makes no band of its level wrong: the simulation has the pressure."""
    observed = sound.observed.copy()
    moved = 5.0 * np.sin(np.arange(len(observed)))
    observed[["force_N", "low_N", "high_N"]] = observed[["force_N", "low_N", "high_N"]].add(moved, axis=0)
    assert held.held_along(replace(sound, observed=observed)) == held.held_along(sound)


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
    limits = (held.between_levels(view), held.beyond_levels(view))
    assert tuple(limit.level if limit else None for limit in limits) == (between, beyond)
    if limits[0]:
        assert f"{100 * (inside[1] + inside[2]) / 2:.0f} % of its readings" in limits[0].sentence


def test_a_stray_reading_of_its_own_level_counts_as_one(sound: CalibrationView) -> None:
    left_out = left_out_levels((0.9, 0.92, 0.0, 0.9))
    left_out["readings"] = [60, 60, 1, 60]
    view = replace(sound, left_out=left_out)
    found = held.held_between(view)
    assert found is not None and found.readings == 61
    assert found.share == pytest.approx(0.92 * 60 / 61)
    assert held.between_levels(view) is None


def test_levels_that_could_not_be_left_out_are_no_good_news(sound: CalibrationView) -> None:
    told = ("inner levels lie", "recorded pressures")
    assert not any(words in reason for reason in assess(sound).reasons for words in told)
    reasons = assess(replace(sound, left_out=left_out_levels((0.9, 0.9, 0.9)))).reasons
    few = assess(replace(sound, left_out=left_out_levels((0.5, 0.5, 0.5), readings=9)))
    assert few.reasons == assess(sound).reasons
    assert "the inner levels lie in the bands that the others give" in reasons[-1]
