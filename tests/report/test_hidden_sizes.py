"""What the page says of sizes that could hide: which bands exclude zero, where a band can hold it."""

from __future__ import annotations

from typing import Any

import pytest
from criticism.cases import problem_of, specimen_of

from mpam_calib.model.effect import effect
from mpam_calib.model.priors import Parameter
from mpam_calib.report.blocks import Text
from mpam_calib.report.diagnosis import _limits, _without_limit

IDS = ("length_offset", "rig_compliance")
"""One of either sign, and one that is never below zero."""


@pytest.fixture(scope="module")
def parameters() -> dict[str, Parameter]:
    setting = problem_of(specimen_of("develop-null-006")).model.setting
    return {p.name: p for e in IDS for p in effect(e).parameters(setting)}


def told_of(parameters: dict[str, Parameter], low: float, high: float) -> Text:
    """What the page says of an offset with these ends, beside a fixture that may give a little."""
    offset, compliance = parameters
    content: dict[str, Any] = {
        "causes": [],
        "not_tested": [],
        "limits": [
            {"id": "length_offset", "parameters": {offset: {"q05": low, "q95": high}}},
            {"id": "rig_compliance", "parameters": {compliance: {"q05": 1e-6, "q95": 1e-4}}},
        ],
    }
    text = _limits(content, parameters, specimen_of("develop-null-006"))[0]
    assert isinstance(text, Text)
    return text


@pytest.mark.parametrize(("low", "named"), [(0.1, True), (-0.1, False)])
def test_a_band_of_either_sign_that_excludes_zero_is_pointed_out(
    parameters: dict[str, Parameter], low: float, named: bool
) -> None:
    text = told_of(parameters, low, 0.3)
    assert ("length offset" in text.html) == named
    assert "compliance" not in text.html
    # "Adequate" may stand beside a likelier cause: nothing is shown, but something was found.
    assert text.html.startswith("Nothing was shown; ")
    # A band may be that of one kind: a creep of the bladder alone hides where one of the force would not.
    assert "in one of its kinds at least" in text.html


def test_an_effect_that_the_data_have_no_room_for_is_told_from_one_that_may_hide(
    parameters: dict[str, Parameter],
) -> None:
    text = told_of(parameters, 0.0, 0.0)
    assert "no room for any size of: length offset." in text.html
    assert "exclude zero" not in text.html


def test_effects_without_a_limit_are_named(parameters: dict[str, Parameter]) -> None:
    """Not those that are causes, that have one, or that these data are silent on anyway."""
    band = {"q05": -0.1, "q95": 0.3}
    content: dict[str, Any] = {
        "causes": [{"id": "dead_band"}],
        "limits": [{"id": "length_offset", "parameters": {next(iter(parameters)): band}}],
        "not_tested": [{"id": "creep", "why": "no clock"}],
    }
    tested = ("creep", "dead_band", "law_shape", "length_offset")
    blocks = _limits(content, parameters, specimen_of("develop-null-006"), tested)
    (line,) = _without_limit(content, tested)
    assert isinstance(line, Text)
    assert line.html.startswith(f"No limit is stated for: {effect('law_shape').title.lower()}. ")
    assert blocks[-1] == line
    assert _without_limit(content, tested[:2]) == []
    # Also where no effect at all has one.
    (alone,) = _limits(content | {"limits": []}, parameters, specimen_of("develop-null-006"), tested)
    assert isinstance(alone, Text) and "length offset" in alone.html
