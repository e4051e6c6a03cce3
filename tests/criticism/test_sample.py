"""A fixed sample of every kind of hidden case: a guard against falling back, not the figure to quote.

The rates to quote come from the whole sets (``make score``).
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest
from rig import sets

from criticism.score import Scored, score_case
from mpam_calib.posterior.density.pool import settle_worker

SAMPLE = (
    "develop-null-000",
    "develop-separable-000",
    "develop-separable-019",
    "develop-separable-014",
    "develop-outside-000",
)
"""Of few strokes: without a cause, with one, two and three, and from outside the catalogue."""


@pytest.fixture(scope="module")
def scored() -> dict[str, list[Scored]]:
    chosen = [recipe for recipe in sets.recipes("develop") if recipe.name in SAMPLE]
    with ProcessPoolExecutor(2, mp_context=get_context("fork"), initializer=settle_worker) as pool:
        found = list(pool.map(score_case, chosen))
    assert len(found) == len(SAMPLE)
    return {
        group: [case for case in found if case.group == group] for group in ("null", "separable", "outside")
    }


def test_nothing_is_named_where_nothing_is_hidden(scored: dict[str, list[Scored]]) -> None:
    assert [case.word for case in scored["null"]] == ["adequate"] * len(scored["null"])


def test_hidden_causes_lead_and_wrong_names_are_rare(scored: dict[str, list[Scored]]) -> None:
    cases = scored["separable"]
    first = sum(case.listed[:1] == (case.truth,) for case in cases)
    wrong = sum(case.word == "named" and case.named != case.truth for case in cases)
    assert first >= 2, [(case.name, case.word, sorted(case.named)) for case in cases]
    assert wrong == 0


def test_what_is_outside_the_catalogue_gets_no_name(scored: dict[str, list[Scored]]) -> None:
    assert [case.word for case in scored["outside"]] == ["unexplained"] * len(scored["outside"])
    assert all(case.named <= case.truth for case in scored["outside"])
