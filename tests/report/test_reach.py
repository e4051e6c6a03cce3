"""What is said of numbers that the readings do not reach."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from mpam_calib.report import reach, trust
from mpam_calib.report.calibration import calibration_page
from mpam_calib.report.trust import assess
from mpam_calib.report.view import CalibrationView

from .synthetic import Z, muscle
from .test_calibration_page import words_of


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    return muscle(n_draws=400)


def flagged(view: CalibrationView, quantity: str, *levels: float) -> CalibrationView:
    """The view with a number marked as outside the readings at some levels."""
    bands = view.bands.copy()
    rows = (bands["quantity"] == quantity) & bands["pressure_kPa"].isin(levels)
    bands.loc[rows, "extrapolated"] = True
    return replace(view, bands=bands)


def cut(view: CalibrationView, share: float, free: float = 0.0) -> CalibrationView:
    """Loops that end at a share of the free contraction, and free contractions read at 0, 1, ... of it."""
    top = view.at_level("free_contraction", 250.0)
    assert top is not None
    loops = view.observed[view.observed["contraction"] <= share * top["mean"]]
    row = {"kind": "free_contraction", "level_kPa": 250.0, "pressure_kPa": 250.0, "censored": False}
    read = pd.DataFrame([row | {"contraction": free * top["mean"]}] if free else [])
    return replace(view, observed=pd.concat([loops, read]))


def test_only_the_top_level_counts(sound: CalibrationView) -> None:
    low, high = (flagged(cut(sound, 0.5), "free_contraction", level) for level in (50.0, 250.0))
    assert reach.extrapolation(low) is None
    # Other levels may well be extrapolated: what is fine is said of the numbers in the headline alone.
    assert "no headline number is extrapolated" in assess(low).reasons[-1]
    assert "nothing is extrapolated" not in " ".join(assess(low).reasons)
    limit = reach.extrapolation(high)
    assert limit is not None and limit.level == "caution"
    assert "free contraction at 250 kPa" in limit.sentence


@pytest.mark.parametrize(
    ("share", "free", "told"),
    [
        (0.97, 0.0, ""),
        (0.75, 0.0, "The readings go to 75 % of the free contraction"),
        (0.0, 0.0, "No reading comes near the free contraction"),
        (0.5, 0.98, ""),  # the free contraction itself was read
        (-1.0, 0.98, ""),  # and nothing else
    ],
)
def test_how_far_the_readings_go_is_said_where_more_than_a_tenth_is_unseen(
    sound: CalibrationView, share: float, free: float, told: str
) -> None:
    view = flagged(cut(sound, share, free), "free_contraction", 250.0)
    limit = reach.extrapolation(view)
    assert (limit.sentence if limit else "").startswith(told)
    assert (limit is not None) == bool(told)
    assert ("no headline number is extrapolated by more than 10 %" in assess(view).reasons[-1]) != bool(told)


def test_readings_of_other_levels_do_not_stand_in_for_the_top_one_s(sound: CalibrationView) -> None:
    """Those at 200 kPa go almost as far as the free contraction at 250."""
    ended = cut(sound, 0.75).observed
    others = sound.observed[sound.observed["level_kPa"] < 250.0]
    view = replace(sound, observed=pd.concat([ended[ended["level_kPa"] == 250.0], others]))
    limit = reach.extrapolation(flagged(view, "free_contraction", 250.0))
    assert limit is not None
    assert limit.sentence.startswith("The readings go to 75 % of the free contraction at 250 kPa")


@pytest.mark.parametrize(("pressure", "told"), [(230.0, True), (247.0, True), (248.0, False), (252.0, False)])
def test_a_free_contraction_read_at_another_pressure_is_not_that_of_the_top_level(
    sound: CalibrationView, pressure: float, told: bool
) -> None:
    view = flagged(cut(sound, 0.5, 0.98), "free_contraction", 250.0)
    observed = view.observed.copy()
    observed.loc[observed["kind"] == "free_contraction", "pressure_kPa"] = pressure
    limit = reach.extrapolation(replace(view, observed=observed))
    assert (limit is not None) == told
    if limit is not None:
        assert limit.sentence.startswith("The readings go to 50 % of the free contraction at 250 kPa")


def test_a_pressure_beyond_the_readings(sound: CalibrationView) -> None:
    limit = reach.extrapolation(flagged(sound, "blocked_force_N", 250.0))
    assert limit is not None and limit.brief == "the blocked force is extrapolated"


def test_a_band_that_ends_where_the_curves_do(sound: CalibrationView) -> None:
    row = sound.at_level("free_contraction", 250.0)
    assert row is not None
    assert reach.cut_off(sound) is None
    assert reach.cut_off(replace(sound, curves_end=float(row["q95"]) + 0.01)) is None
    ended = replace(sound, curves_end=float(row["q95"]))
    limit = reach.cut_off(ended)
    assert limit is not None and limit.level == "caution"
    assert f"up to a contraction of {100 * np.round(row['q95'], 3):.3g} %" in limit.sentence
    assert "ends only where the curves end." in calibration_page(ended).render()
    assert "where the curves end" not in calibration_page(sound).render()


LOW, END = 0.30, 0.333
"""5 % quantile of a free contraction, and the end of the curves."""


def ending(view: CalibrationView, which: str) -> CalibrationView:
    """The view with curves that end at 33.3 %, before some, most or all of them have stopped pulling."""
    bands = view.bands.copy()
    rows = (bands["quantity"] == "free_contraction") & (bands["pressure_kPa"] == 250.0)
    names = {"some": ["q95"], "most": ["q50", "q75", "q95"], "all": list(Z)}[which]
    bands.loc[rows, [*Z, "mean"]] = [LOW, 0.31, 0.315, 0.32, 0.325, 0.316]
    bands.loc[rows, names + (["mean"] if which == "all" else [])] = END
    bands.loc[rows, "extrapolated"] = True
    return replace(view, bands=bands, curves_end=END)


@pytest.mark.parametrize(
    ("which", "headline", "cells"),
    [
        (
            "some",
            "shortens by at least 31.6 % of its length without load (90 % band 30.0 to beyond 33.3 %)",
            ("at least 31.6", "30.0 to beyond 33.3"),
        ),
        ("most", "still pulls at 33.3 % contraction.", ("still pulls at 33.3", "30.0 to beyond 33.3")),
        ("all", "still pulls at 33.3 % contraction.", ("still pulls at 33.3", "–")),
    ],
)
def test_a_free_contraction_beyond_the_curves_is_not_stated(
    sound: CalibrationView, which: str, headline: str, cells: tuple[str, str]
) -> None:
    """The end of the curves, at which those without a root count, is no result, and its band no band."""
    view = ending(cut(sound, 0.5), which)
    html = calibration_page(view).render()
    lead, rest = (words_of(part) for part in html.split("<nav"))
    assert headline in lead
    assert f"{which.capitalize()} of the plausible curves pull wherever" in lead
    assert "".join(cells) in rest
    assert "33.300" not in lead + rest
    # What has no upper end is neither wide nor narrow.
    assert [name for name, *_ in trust.headline_bands(view)] == ["blocked force"]
    assert "the bands are within" in " ".join(assess(sound).reasons)
    assert "the bands are within" not in " ".join(assess(view).reasons)
    # How far the readings go is told beside a free contraction that was found only.
    assert ("of the free contraction at 250 kPa" in lead) == (which == "some")


def test_forces_between_the_ends_of_the_curve_are_not_to_be_taken_where_none_was_read(
    sound: CalibrationView,
) -> None:
    assert reach.between_ends(sound) is None
    assert reach.between_ends(cut(sound, 0.5, 0.98)) is None
    limit = reach.between_ends(cut(sound, -1.0, 0.98))
    assert limit is not None and limit.level == "caution"
    assert limit.sentence in " ".join(assess(cut(sound, -1.0, 0.98)).reasons)
