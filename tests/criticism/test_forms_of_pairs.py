"""Two causes that act at the same moment: the forms of both are to be found, not of one after the other."""

from __future__ import annotations

from dataclasses import replace

import pytest
from rig import sets

from criticism.test_hypotheses import problem_of, specimen_of
from criticism.test_sizes import force_with
from mpam_calib.criticism.fit import Fit, fit
from mpam_calib.criticism.forms import forms_of, price
from mpam_calib.criticism.problem import Problem
from mpam_calib.criticism.refits import ended, with_better_forms
from mpam_calib.criticism.spread import held_problem, spread_over

TRUE = frozenset({"creep:early", "presliding"})
"""A level that was held before its first stroke, which a turn began: both act on its first readings."""
SIZES = {"creep_per_decade": 0.7, "creep_before_s": 1.0, "reversal_mm": 0.5}


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Both causes hidden in a case that hides nothing else."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "tensile")
    bare = problem_of(specimen_of(recipe.name))
    start = fit(bare, frozenset(), 0)
    change = force_with(bare, start, "+".join(TRUE), SIZES) - start.force
    return bare.with_force(bare.force + change)


def priced(found: Fit) -> Fit:
    """With what the choice of its forms costs, as a search has it."""
    return replace(found, log_evidence=found.log_evidence - sum(map(price, sorted(found.effects))))


def with_better_forms_of(found: Fit, effect: str) -> Fit:
    """The best fit in which this effect alone has another form."""
    (kept,) = (e for e in found.effects if e.partition(":")[0] != effect)
    others = [
        priced(fit(held_problem(), frozenset({kept, form}), 0, ended(found))) for form in forms_of(effect)
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
