"""What the page says of causes: when left-out readings speak against them, and sizes beside bends."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from criticism.cases import problem_of, specimen_of

from mpam_calib.model.effect import effect
from mpam_calib.report.blocks import DataTable, Notice, Text
from mpam_calib.report.diagnosis import (
    AMONG_THEMSELVES,
    BENT,
    BUT_AN_INSTRUMENT,
    FORMS,
    _alternatives,
    _causes,
    _gain,
)
from mpam_calib.report.diagnosis_lead import _next, _unproven

HOLDS = {
    "held_out": "cycle",
    "rmse_before_N": 2.0,
    "rmse_after_N": 1.0,
    "rmse_named_N": 0.9,
    "elpd_gain": 80.0,
    "elpd_gain_se": 2.0,
    "elpd_gain_named": 90.0,
    "elpd_gain_named_se": 2.0,
    "coverage90_after": 0.9,
    "coverage90_named": 0.9,
}


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rmse_named_N": 2.05}, "2.05 N with these causes and 2.00 N without"),
        ({"elpd_gain_named": -3.0}, "less probable"),
        ({"coverage90_named": 0.58}, "58 % of them"),
    ],
)
def test_left_out_readings_that_speak_against_the_causes(changed: dict[str, Any], said: str) -> None:
    (text,) = _unproven({"gain": HOLDS | changed})
    assert said in text
    assert "whole cycles" in text and "speak against this result" in text


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"rmse_after_N": 2.05}, "2.05 N with such causes and 2.00 N without"),
        ({"elpd_gain": -3.0}, "less probable"),
        ({"coverage90_after": 0.58}, "58 % of them"),
    ],
)
def test_left_out_readings_against_what_a_fold_chose_by_itself(changed: dict[str, Any], said: str) -> None:
    """They say how far the choice can be relied on, not that the causes of all rows are wrong."""
    (text,) = _unproven({"gain": HOLDS | changed})
    assert said in text
    assert "0.900 N" in text and "speak against this result" not in text


def test_left_out_readings_that_say_nothing_against_them() -> None:
    assert _unproven({"gain": HOLDS}) == _unproven({"gain": None}) == []


@pytest.mark.parametrize(
    "changed",
    [
        {"elpd_gain_named": -0.3, "elpd_gain_named_se": 9.0},
        {"elpd_gain": -0.3, "elpd_gain_se": 9.0},
        {"rmse_named_N": 2.0001},
        {"rmse_after_N": 2.0001},
        {"rmse_named_N": 2.0},
    ],
)
def test_left_out_readings_within_their_error_say_nothing(changed: dict[str, Any]) -> None:
    """Nor do errors that would print alike."""
    assert _unproven({"gain": HOLDS | changed}) == []


@pytest.mark.parametrize("form", ["", "bent"])
def test_a_cause_states_its_probability_once_and_warns_of_bends(form: str) -> None:
    setting = problem_of(specimen_of("develop-null-006")).model.setting
    assert setting is not None
    parameters = {p.name: p for p in effect(f"creep:{form}".strip(":")).parameters(setting)}
    sizes = {name: {"mean": 0.1, "sd": 0.01, "q05": 0.08, "q95": 0.12} for name in parameters}
    cause = {"id": "creep", "form": form, "probability": 0.98, "share_of_misfit": 0.7, "parameters": sizes}
    cause["forms"] = [{"form": form, "probability": 1.0}]
    text, told, sized = _causes([cause], parameters)
    assert isinstance(text, Text)
    assert isinstance(told, DataTable)
    assert isinstance(sized, DataTable)
    assert (BENT in text.html) == (form == "bent")
    assert [row[:3] for row in told.rows] == [["Creep", "0.98", "0.7"]]
    assert len(sized.rows) == len(parameters) > (form == "bent")
    assert [row[1:4] for row in sized.rows] == [[name, "0.100", "0.080–0.120"] for name in parameters]
    assert [row[-1].endswith(", before its bends") for row in sized.rows] == [
        form == "bent" and number == 0 for number in range(len(parameters))
    ]


def test_a_cause_without_a_size_is_told_all_the_same() -> None:
    cause = {"id": "braid_kinematics", "form": "", "probability": 0.98, "share_of_misfit": 0.7}
    _, told = _causes([cause | {"parameters": {}, "forms": [{"form": "", "probability": 1.0}]}], {})
    assert isinstance(told, DataTable)
    assert len(told.rows) == 1


@pytest.mark.parametrize(("probability", "open_"), [(0.97, False), (0.6, True)])
def test_a_cause_whose_equation_is_open_is_told(probability: float, open_: bool) -> None:
    """By the form that the simulation is extended by, whichever is the likeliest."""
    forms = [{"form": "", "probability": 1.0 - probability}, {"form": "power", "probability": probability}]
    cause = {"id": "creep", "form": "power", "forms": forms, "probability": 0.98, "share_of_misfit": 0.7}
    cause["parameters"] = {}
    text, _ = _causes([cause], {})
    assert isinstance(text, Text)
    assert ("other equations open for: creep." in text.html) == open_


def test_other_sets_are_counted_without_a_word_that_the_table_contradicts() -> None:
    """Sets at < 0.001 under a cause at > 0.999 are not hard to tell from it."""
    verdict = SimpleNamespace(near=lambda: 4, likeliest=lambda: 5, marginals={})
    alternatives = [{"ids": ["dead_band", "presliding"], "probability": 1e-4}]
    causes = [{"id": "dead_band", "parameters": {}}]
    content: dict[str, Any] = {"verdict": "named", "alternatives": alternatives, "causes": causes}
    found: Any = SimpleNamespace(verdict=verdict)
    text, _ = _alternatives(content, found, specimen_of("develop-null-006"))
    assert isinstance(text, Text)
    assert "within 10 nats of the likeliest (a factor of 22,000 in probability): 4." in text.html
    assert "hardly" not in text.html


@pytest.mark.parametrize(
    ("word", "left", "said"),
    [
        ("named", False, None),
        ("unexplained", True, AMONG_THEMSELVES),
        ("unexplained", False, BUT_AN_INSTRUMENT),
    ],
)
def test_a_set_that_is_sure_beside_others_is_not_said_to_be_there(
    word: str, left: bool, said: str | None
) -> None:
    """Beside structure that no set removes even a probability of 0.96 only ranks it."""
    verdict = SimpleNamespace(near=lambda: 0, likeliest=lambda: 5, marginals={}, left=left)
    content: dict[str, Any] = {
        "verdict": word,
        "alternatives": [{"ids": ["braid_angle"], "probability": 0.964}],
        "causes": [],
        "instrument": {"fault": "load_cell"},
    }
    found: Any = SimpleNamespace(verdict=verdict)
    text, _ = _alternatives(content, found, specimen_of("develop-null-006"))
    assert isinstance(text, Text)
    assert ("compare" in text.html) == (said is not None)
    assert said is None or said.format("a load cell") in text.html


def test_the_stated_share_of_true_sets_is_that_of_the_documents() -> None:
    documents = Path(__file__).parents[2] / "docs" / "how_far_to_trust_a_diagnosis.md"
    assert "six of seven" in documents.read_text(encoding="utf-8")
    assert "six of seven" in FORMS


def test_what_comes_next_is_told_where_an_extended_model_holds_a_cause() -> None:
    (notice,) = _next([{"id": "dead_band"}])
    assert isinstance(notice, Notice)
    assert "mpam-calib calibrate RUN/extended -o" in notice.html
    assert _next([]) == []


@pytest.mark.parametrize(
    ("nats", "said"),
    [(12345.6, "12300 ± 2.0 nats more probable"), (-41.26, "41.3 ± 2.0 nats less probable")],
)
def test_a_loss_is_not_told_as_a_gain(nats: float, said: str) -> None:
    gain = HOLDS | {"elpd_gain": nats, "elpd_gain_named": nats, "coverage90_before": 0.3}
    text, _ = _gain({"gain": gain | {"folds": 5, "folds_same_set": 4}})
    assert isinstance(text, Text)
    assert text.html.count(said) == 2
    assert text.html.startswith("Whole cycles were held out")
