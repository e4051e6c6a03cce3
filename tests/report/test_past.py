"""Bands are of the settled muscle: a first screen says so where the readings are not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mpam_calib.report.calibration import calibration_page
from mpam_calib.report.past import past
from mpam_calib.report.trust import assess
from mpam_calib.report.view import CalibrationView

from .synthetic import muscle


@pytest.fixture(scope="module")
def sound() -> CalibrationView:
    return muscle(n_draws=400)


def off(view: CalibrationView, effects: tuple[str, ...], **branch_N: float) -> CalibrationView:
    """Readings that lie off the settled muscle by so much on each branch."""
    rows = view.observed.assign(past_N=view.observed["branch"].map(branch_N))
    return replace(view, observed=rows, simulation=view.simulation.model_copy(update={"effects": effects}))


@pytest.mark.parametrize(
    ("effects", "loading", "unloading", "level"),
    [
        (("creep",), -12.0, -8.0, "caution"),
        (("stress_softening:power", "force_drift"), 12.0, 8.0, "caution"),
        (("force_drift",), 12.0, 8.0, "good"),
        (("presliding",), 12.0, 8.0, "caution"),  # no load cell that wanders is declared
        (("creep",), 0.4, 0.4, None),  # within the band
        (("presliding",), -10.0, 10.0, None),  # what one branch loses the other gains
    ],
)
def test_readings_off_the_settled_muscle_are_told(
    sound: CalibrationView, effects: tuple[str, ...], loading: float, unloading: float, level: str | None
) -> None:
    view = off(sound, effects, loading=loading, unloading=unloading)
    limit = past(view)
    assert (limit and limit.level) == level
    page = calibration_page(view).render()
    assert ("Bands are of the settled muscle" in page) == (level is not None)
    if level == "caution":
        verdict = assess(view)
        assert verdict.level == "caution"
        assert f"lie 10 N {'above' if loading > 0.0 else 'below'}" in verdict.sentence
