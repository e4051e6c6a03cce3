"""Two causes whose forms are to be found together, not one after the other.

They act at the same moment, or a bend of one holds what the other's form lacks.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from criticism.cases import null_recipe, problem_of, specimen_of
from criticism.test_sizes import force_with
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import Fit, fit
from mpam_calib.criticism.fitting.forms import forms_of, price
from mpam_calib.criticism.fitting.refits import (
    causes_of,
    in_another_form,
    other_forms,
    with_better_forms,
    with_doubt,
)
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.tasks.spread import Alone, held_problem, spread_over

TRUE = frozenset({"creep:early", "presliding"})
"""A level that was held before its first stroke, which a turn began: both act on its first readings."""
SIZES = {"creep_per_decade": 0.7, "creep_before_s": 1.0, "reversal_mm": 0.5}
CURVED = frozenset({"pressure_droop:saturating", "tip_shape:power"})
"""A droop and ends that both bend along the stroke."""
CURVED_SIZES = {"droop_percent": 1.0, "droop_steepness": -0.4, "tip_factor": 0.5, "tip_exponent": 1.5}


def hiding(causes: frozenset[str], sizes: dict[str, float]) -> Problem:
    """Both causes hidden in a case that hides nothing else."""
    bare = problem_of(specimen_of(null_recipe().name))
    start = fit(bare, frozenset(), 0)
    change = force_with(bare, start, "+".join(causes), sizes) - start.force
    return bare.with_force(bare.force + change)


@pytest.fixture(scope="module")
def problem() -> Problem:
    return hiding(TRUE, SIZES)


@pytest.fixture(scope="module")
def curved() -> Problem:
    return hiding(CURVED, CURVED_SIZES)


def doubted(problem: Problem, causes: frozenset[str]) -> Fit:
    """A fit as the leading sets have it in the end."""
    with spread_over(problem, 1):
        return with_doubt(priced(fit(problem, causes, 0)))


def priced(found: Fit) -> Fit:
    """With what the choice of its forms costs, as a search has it."""
    return replace(found, log_evidence=found.log_evidence - sum(map(price, sorted(found.effects))))


def in_two_other_equations(problem: Problem, found: Fit) -> Fit:
    """What a search makes of a fit that it has alone."""
    causes = causes_of(found)
    search = Search(problem, tuple(sorted(causes)), Alone(problem), {(causes, found.size): found})
    search.in_two_other_equations([causes])
    return search.fits[causes, found.size]


def with_better_forms_of(found: Fit, effect: str) -> Fit:
    """The best fit in which this effect alone has another form."""
    (kept,) = (e for e in found.effects if e.partition(":")[0] != effect)
    others = [
        priced(fit(held_problem(), frozenset({kept, form}), 0, found.ended)) for form in forms_of(effect)
    ]
    return max(others, key=lambda f: f.log_evidence)


def test_a_pair_comes_to_its_equations_from_forms_that_make_up_for_each_other(problem: Problem) -> None:
    with spread_over(problem, 1):
        trapped = priced(fit(problem, frozenset({"creep:bent", "presliding:rest"}), 0))
        alone = [with_better_forms_of(trapped, e) for e in ("creep", "presliding")]
        found = with_better_forms(trapped)
    true = priced(fit(problem, TRUE, 0))
    assert max(f.log_evidence for f in alone) < true.log_evidence - 10.0
    assert found.effects == TRUE
    assert found.log_evidence == pytest.approx(true.log_evidence, abs=0.05)


def test_a_pair_in_its_best_forms_stays_there(problem: Problem) -> None:
    true = priced(fit(problem, TRUE, 0))
    with spread_over(problem, 1):
        assert with_better_forms(true).effects == TRUE


def test_two_equations_come_out_of_a_bend_that_no_change_of_one_leads_out_of(curved: Problem) -> None:
    trapped, true = doubted(curved, frozenset({"pressure_droop", "tip_shape:bent"})), doubted(curved, CURVED)
    with spread_over(curved, 1):
        alone = [in_another_form((trapped, form)) for form in other_forms(trapped)]
    found = in_two_other_equations(curved, trapped)
    assert max(f.log_evidence for f in alone if f is not None) < true.log_evidence - 10.0
    assert found.effects == CURVED
    assert found.log_evidence == pytest.approx(true.log_evidence, abs=0.05)


def test_no_other_two_are_taken_for_the_best(curved: Problem) -> None:
    true = doubted(curved, CURVED)
    assert in_two_other_equations(curved, true) is true
