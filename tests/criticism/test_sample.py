"""A fixed sample of every kind of hidden case: a guard against falling back, not the figure to quote.

The rates to quote come from the whole sets (``make score``).
"""

from __future__ import annotations

import pytest
from rig import sets

from criticism.score import Scored, score_case

STRIDES = {"null": 12, "separable": 6, "outside": 7}


@pytest.fixture(scope="module")
def scored() -> dict[str, list[Scored]]:
    groups: dict[str, list[Scored]] = {}
    for group, stride in STRIDES.items():
        chosen = [recipe for recipe in sets.recipes("develop") if recipe.group == group][::stride]
        groups[group] = [score_case(recipe) for recipe in chosen]
    return groups


def test_nothing_is_named_where_nothing_is_hidden(scored: dict[str, list[Scored]]) -> None:
    assert [case.word for case in scored["null"]] == ["adequate"] * len(scored["null"])


def test_hidden_causes_lead_and_wrong_names_are_rare(scored: dict[str, list[Scored]]) -> None:
    cases = scored["separable"]
    first = sum(case.listed[0] == case.truth for case in cases)
    wrong = sum(case.word == "named" and case.named != case.truth for case in cases)
    assert first >= 4, [(case.name, case.word, sorted(case.listed[0])) for case in cases]
    assert wrong <= 1


def test_what_is_outside_the_catalogue_gets_no_name(scored: dict[str, list[Scored]]) -> None:
    assert all(case.word != "named" for case in scored["outside"])
