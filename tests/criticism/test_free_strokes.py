"""A set's score beside free strokes: that of the search where the remainder is its own, on the same scale."""

from __future__ import annotations

import numpy as np
import pytest

from criticism.cases import problem_of, specimen_of
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.forms import price
from mpam_calib.criticism.fitting.refits import Set
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.tasks.spread import Alone
from mpam_calib.criticism.unexplained.free_strokes import score_beside

LARGEST = len(SIZES) - 1
NOTHING: Set = frozenset()
CAUSE: Set = frozenset(["force_drift"])


@pytest.fixture(scope="module")
def found() -> Search:
    problem = problem_of(specimen_of("develop-null-000"))
    search = Search(problem, ("force_drift", "creep"), Alone(problem))
    search.refit_all((effects, LARGEST) for effects in (NOTHING, CAUSE))
    return search


@pytest.mark.parametrize("effects", [NOTHING, CAUSE])
def test_beside_the_search_s_own_remainder_it_is_its_own_score(found: Search, effects: Set) -> None:
    known = found.fits[effects, LARGEST]
    expected = known.log_evidence + found.log_prior(effects)
    assert score_beside(found, found.problem, effects) == pytest.approx(expected, abs=0.05)


def test_a_form_costs_its_price(found: Search) -> None:
    """As it does in the search: one of many forms of the same cause is no likelier for its being there."""
    form = "force_drift:root"
    assert price(form) > 0.5
    bare = fit(found.problem, frozenset([form]), LARGEST)
    found.fits[CAUSE, LARGEST] = bare
    score = score_beside(found, found.problem, CAUSE)
    assert score == pytest.approx(bare.log_evidence - price(form) + found.log_prior(CAUSE), abs=0.05)


def lead_of_drift(search: Search, problem: Problem, off: np.ndarray) -> float:
    """Nats by which a drift leads nothing on readings that are off by so much."""
    moved = problem.with_force(problem.force + off)
    return score_beside(search, moved, CAUSE) - score_beside(search, moved, NOTHING)


def test_what_every_stroke_has_in_a_way_of_its_own_is_no_drift_beside_free_strokes(found: Search) -> None:
    """Steps from stroke to stroke, upwards by chance; beside the search's own remainder they pass for it."""
    own = found.problem
    steps = np.cumsum(np.random.default_rng(1).uniform(0.0, 2.0, own.stroke.max() + 1))
    off = 8.0 * own.noise_level.total * (steps / steps.max())[own.stroke]
    search = Search(own, found.tested, Alone(own))
    search.fits = {(s, LARGEST): fit(own, s, LARGEST) for s in (NOTHING, CAUSE)}
    assert lead_of_drift(search, own.with_free_strokes(), off) < lead_of_drift(search, own, off)
