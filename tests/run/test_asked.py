"""What ``predict`` says of pressures that were not recorded: a line a kind, nothing where all is well."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mpam_calib.posterior.stored import StoredRun, load_run
from mpam_calib.prediction.curves import contraction_grid
from mpam_calib.prediction.recorded import RECORDED, Recorded
from mpam_calib.run.asked import KEPT, kept_left_out, remarks

from .command import Here

NOTHING = pd.DataFrame({"quantity": ["free_contraction"], "pressure_kPa": [100.0], "q95": [0.1]})


@pytest.fixture(scope="module")
def stored(muscle_run: Path) -> StoredRun:
    """Levels 100, 150, 200 kPa."""
    return load_run(muscle_run)


def said(stored: StoredRun, *pressures: float, inner: float | None = 0.9, outer: float = 0.9) -> list[str]:
    rows = [(100.0, 200, outer, True), (150.0, 200, inner, False), (200.0, 200, outer, True)]
    left_out = pd.DataFrame(rows, columns=list(KEPT))
    state = {} if inner is None else {"left_out": kept_left_out(left_out)}
    return remarks(stored.model, state, np.array(pressures), NOTHING)


def test_recorded_pressures_and_levels_that_are_foreseen_are_silent(stored: StoredRun) -> None:
    assert said(stored, 100.0, 150.0, 200.0, inner=0.5) == []
    assert said(stored, 101.0, 199.0, inner=0.5) == []
    assert said(stored, 110.0, 125.0) == []


def test_between_levels_the_share_that_was_held_is_told_where_it_is_poor(stored: StoredRun) -> None:
    (line,) = said(stored, 100.0, 125.0, 150.0, 175.0, inner=0.62)
    assert line == (
        "125, 175 kPa lie between the recorded levels: at a level that the fit had not seen, 62 % of "
        "readings fell in bands meant for 90 %"
    )
    (line,) = said(stored, 125.0, inner=None)
    assert line == (
        "125 kPa lies between the recorded levels: this run does not tell how well its bands hold there"
    )


def test_beyond_levels_it_is_told_always(stored: StoredRun) -> None:
    (line,) = said(stored, 50.0, 250.0, outer=0.9)
    assert line.startswith("50, 250 kPa lie beyond the recorded 100 to 200 kPa: these numbers are extrapol")
    assert "90 % of readings fell in bands meant for 90 %" in line
    (line,) = said(stored, 250.0, inner=None)
    assert line.endswith("250 kPa lies beyond the recorded 100 to 200 kPa: these numbers are extrapolated")


def test_blocked_forces_that_were_recorded_beyond_the_levels_are_left_out(stored: StoredRun) -> None:
    blocked = {RECORDED: Recorded(frozenset({"loading"}), (10.0, 260.0)).as_json()}
    few, many = remarks(stored.model, blocked, np.array([50.0, 150.0, 250.0, 300.0]), NOTHING)[:2]
    assert few == "300 kPa lies beyond the recorded 100 to 200 kPa: these numbers are extrapolated"
    assert many == (
        "50, 250 kPa lie beyond the recorded 100 to 200 kPa of all but the blocked force, which alone is not "
        "extrapolated there"
    )


def test_the_run_keeps_what_was_recorded(stored: StoredRun) -> None:
    assert Recorded.kept(stored.state) == Recorded(frozenset({"loading", "unloading"}), None)


def test_many_pressures_are_counted(stored: StoredRun) -> None:
    (line,) = said(stored, *range(210, 310, 10))
    assert line.startswith("210, 220, 230, 240 kPa and 6 more lie beyond")


def test_a_free_contraction_that_is_where_the_curves_end_is_no_free_contraction(stored: StoredRun) -> None:
    end = float(contraction_grid(stored.model, max(stored.model.blueprint.reach))[-1])
    table = NOTHING.assign(q95=end)
    (line,) = remarks(stored.model, {}, np.array([100.0]), table)
    assert line.startswith(f"at 100 kPa the free contraction's q95 of {end:.3g} is only the largest")


def test_the_run_keeps_what_its_report_says_of_levels_left_out(muscle_run: Path) -> None:
    rows = json.loads((muscle_run / "run.json").read_text())["left_out"]
    assert [(row["pressure_kPa"], row["extrapolated"]) for row in rows] == [
        (100.0, True),
        (150.0, False),
        (200.0, True),
    ]
    assert all(0.0 <= row["inside90"] <= 1.0 and row["readings"] > 0 for row in rows)


def test_it_is_a_warning_beside_the_result(run_copy: Path, here: Here) -> None:
    result = here("predict", run_copy, "--pressure", "150:250:50")
    assert result.code == 0
    assert result.out == f"{run_copy / 'predictions.csv'}\n"
    assert result.complaint.startswith("warning: 250 kPa lies beyond the recorded 100 to 200 kPa")
