"""A set's evidence over all forms that its causes may have."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from criticism.test_sizes import force_with
from mpam_calib.criticism.data.problem import SIZE_PRIOR, Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.forms import forms_of
from mpam_calib.criticism.fitting.refits import causes_of, with_doubt
from mpam_calib.criticism.searching.searched import CLOSE, Search
from mpam_calib.criticism.tasks.spread import Alone, spread_over

HIDDEN = {"creep": ("creep_per_decade", 0.1), "force_drift": ("drift_N_per_min", 0.1)}
"""Causes so small that the data hardly tell in which form."""


def searched(problem: Problem, *causes: str) -> Search:
    """What is known of these causes, together or not, once all have their doubts."""
    found = Search(problem, causes, Alone(problem))
    every = [frozenset(causes[:k]) for k in range(len(causes) + 1)]
    found.refit_all([(s, 0) for s in every] + [(frozenset([c]), 0) for c in causes])
    found.polish(every)
    found.doubt(1)
    return found


def evidence(problem: Problem, forms: tuple[str, ...], start: dict[str, float]) -> float:
    """Nats of one choice of forms, doubted."""
    with spread_over(problem, 1):
        return with_doubt(fit(problem, frozenset(forms), 0, start)).log_evidence


def test_one_cause_has_the_evidence_of_all_its_forms(problem: Problem) -> None:
    size, u = HIDDEN["force_drift"]
    made = problem.with_force(force_with(problem, fit(problem, frozenset(), 0), "force_drift", {size: u}))
    found, cause = searched(made, "force_drift"), frozenset({"force_drift"})
    before = found.score(cause)
    found.refit_in_forms([cause])
    base = found.in_forms[cause][0]
    start = base.ended
    every = [evidence(made, (form,), start) for form in forms_of("force_drift")]
    expected = np.logaddexp.reduce(every) + np.log(SIZE_PRIOR[0]) + found.log_prior(cause)
    assert found.score(cause) == pytest.approx(expected, abs=0.05)
    assert found.score(cause) > before + 0.1
    assert found.score_of_best(cause) == pytest.approx(before, abs=0.05)


def test_two_causes_have_nearly_that_of_all_pairs_of_forms(problem: Problem) -> None:
    """One changed at a time stands for both changed at once."""
    start = fit(problem, frozenset(), 0)
    change = sum(force_with(problem, start, c, {size: u}) - start.force for c, (size, u) in HIDDEN.items())
    made = problem.with_force(problem.force + change)
    found, causes = searched(made, *HIDDEN), frozenset(HIDDEN)
    found.refit_in_forms([causes])
    base = found.in_forms[causes][0]
    ended = base.ended
    every = [evidence(made, pair, ended) for pair in product(*map(forms_of, sorted(HIDDEN)))]
    expected = np.logaddexp.reduce(every) + np.log(SIZE_PRIOR[0]) + found.log_prior(causes)
    assert found.score(causes) == pytest.approx(expected, abs=0.1)
    assert found.score(causes) > found.score_of_best(causes) + 0.3


def test_a_set_left_in_a_bend_comes_to_its_equation(problem: Problem) -> None:
    name, cause = "wall_factor", frozenset({"wall_pressure"})
    form, u = "wall_pressure:pressed", {name: 2.0, "wall_exponent": 1.0}
    made = problem.with_force(force_with(problem, fit(problem, frozenset(), 0), form, u))
    found = searched(made, "wall_pressure")
    with spread_over(made, 1):
        bent = with_doubt(fit(made, frozenset({"wall_pressure:bent"}), 0))
    found.fits[cause, 0] = bent
    found.refit_in_forms([cause])
    assert found.best_fit(cause).effects == {form}
    assert found.in_forms[cause][0].effects == {form}


def test_only_sets_that_may_lead_are_gone_through(problem: Problem) -> None:
    cause, (size, _) = "creep", HIDDEN["creep"]
    made = problem.with_force(force_with(problem, fit(problem, frozenset(), 0), cause, {size: 2.0}))
    found = searched(made, cause)
    assert found.score(frozenset()) < found.score(frozenset({cause})) - CLOSE
    found.over_forms()
    assert set(found.in_forms) == {frozenset({cause})}
    assert all(causes_of(f) == {cause} for f in found.in_forms[frozenset({cause})])


@pytest.mark.parametrize("further", [True, False])
def test_what_has_a_further_cause_may_be_left_as_it_is(problem: Problem, further: bool) -> None:
    size, u = HIDDEN["force_drift"]
    made = problem.with_force(
        force_with(problem, fit(problem, frozenset(), 0), "force_drift", {size: 40 * u})
    )
    found, both = searched(made, *HIDDEN), frozenset(HIDDEN)
    assert found.sets[0] == {"force_drift"} and found.score(both) > found.score(found.sets[0]) - CLOSE
    found.over_forms(further)
    assert frozenset({"force_drift"}) in found.in_forms
    assert (both in found.in_forms) == further
