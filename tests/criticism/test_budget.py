"""The misfit budget: every share a part of the misfit, whatever was doubted or where a climb ended."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from criticism.cases import problem_of, specimen_of
from mpam_calib.criticism.budget import misfit_budget, remainder_rms, structured
from mpam_calib.criticism.data.problem import SIZES
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.predicted import beyond_noise
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.tasks.spread import Alone

CAUSES = frozenset(["coulomb_friction", "dead_band"])
CASE = "develop-separable-016"
"""Both are hidden in it, with tensile moduli."""


@pytest.fixture(scope="module")
def found() -> Search:
    problem = problem_of(specimen_of(CASE))
    search = Search(problem, tuple(CAUSES), Alone(problem))
    parts = [frozenset[str](), *(frozenset([e]) for e in CAUSES), CAUSES]
    search.refit_all((part, size) for part in parts for size in range(len(SIZES)))
    return search


def doubted(search: Search) -> Search:
    """The same, in the state after the doubt."""
    fresh = replace(search, fits=dict(search.fits))
    fresh.doubt(leading=24)
    return fresh


def test_shares_add_up_to_what_the_causes_explain(found: Search) -> None:
    budget = misfit_budget(doubted(found), CAUSES)
    assert all(share > 0.02 for share in budget.shares.values())
    explained = 1.0 - (budget.after / budget.before) ** 2
    assert sum(budget.shares.values()) == pytest.approx(explained, abs=1e-9)
    assert explained > 0.9


def test_it_is_that_of_the_forms_that_are_reported(found: Search) -> None:
    """Whatever forms the search had before."""
    search = doubted(found)
    key = (CAUSES, 0)
    search.searched[key] = replace(search.searched[key], force=0.0 * search.searched[key].force)
    at_word = fit(found.problem, search.best_fit(CAUSES).effects, 0)
    left = structured(found.problem, at_word.force)
    assert misfit_budget(search, CAUSES).after ** 2 == pytest.approx(left, abs=1e-3)


def test_a_doubted_fit_that_leaves_its_force_to_the_doubt_takes_no_newton_from_a_cause(found: Search) -> None:
    search = doubted(found)
    for e in CAUSES:
        key = (frozenset([e]), 0)
        search.fits[key] = replace(search.fits[key], force=2.0 * search.fits[key].force)
    assert misfit_budget(search, CAUSES) == misfit_budget(doubted(found), CAUSES)


def test_a_climb_that_ended_badly_gives_no_negative_share(found: Search) -> None:
    alone, bad = found.spread, []

    def badly(function, tasks):
        for one in alone(function, tasks):
            if one is not None and {e.partition(":")[0] for e in one.effects} == {"dead_band"}:
                bad.append(replace(one, force=2.0 * one.force))
                yield bad[-1]
            else:
                yield one

    shares = misfit_budget(replace(found, spread=badly), CAUSES).shares
    assert len(bad) == 1 and structured(found.problem, bad[0].force) > 100.0
    assert min(shares.values()) >= 0.0
    assert sum(shares.values()) <= 1.0 + 1e-9


def test_rows_at_rest_hide_no_misfit_of_the_others() -> None:
    """A wave of 3 N rms under 1 N of noise, and every tenth row in doubt by 20 N."""
    rng = np.random.default_rng(5)
    sd = np.where(np.arange(4000) % 10 == 0, 20.0, 1.0)
    wave = 3.0 * np.sqrt(2.0) * np.sin(0.01 * np.arange(4000))
    assert beyond_noise(wave + sd * rng.standard_normal(4000), sd**2) == pytest.approx(9.0, rel=0.05)
    assert beyond_noise(sd * rng.standard_normal(4000), sd**2) < 0.1


def test_a_crosshead_that_rests_leaves_the_budget_as_it_is(found: Search) -> None:
    moving = misfit_budget(found, CAUSES)
    problem = found.problem
    rest = np.arange(len(problem)) % 11 == 0  # Every place in a stroke in turn.
    doubt = np.where(rest, 20.0 * problem.noise_level.total, 0.0)
    resting = replace(found, problem=replace(problem, noise=problem.noise + np.diag(doubt**2)))
    budget = misfit_budget(resting, CAUSES)
    assert budget.before == pytest.approx(moving.before, rel=0.1)
    assert budget.after == pytest.approx(moving.after, abs=0.1 * moving.before)
    assert budget.shares == pytest.approx(moving.shares, abs=0.1)


def test_newtons_are_root_mean_squares_of_what_the_equations_leave(found: Search) -> None:
    """Before and after beyond the noise, which is a reading's."""
    budget, problem = misfit_budget(found, CAUSES), found.problem
    for effects, told in ((frozenset[str](), budget.before), (CAUSES, budget.after)):
        forms = found.best_fit(CAUSES).effects if effects else effects
        left = problem.force - fit(problem, forms, 0).force
        square = float(np.mean(left**2) - np.mean(np.diagonal(problem.noise)))
        assert told == pytest.approx(np.sqrt(max(square, 0.0)), abs=0.02 * budget.before)
    assert budget.noise == pytest.approx(problem.noise_level.total, rel=0.05)


def test_no_more_remains_than_the_equations_leave(found: Search) -> None:
    """Without causes; beside a remainder the same fit is a worse one, with more for it to hold."""
    none = frozenset[str]()
    budget = misfit_budget(found, none)
    assert remainder_rms(found.problem, found.best_fit(none)) > 1.1 * budget.before
    assert budget.remainder == budget.after == budget.before


def test_noise_is_no_more_than_all_that_is_left_of_the_readings(found: Search) -> None:
    """Noise that is told from windows may be told as far larger: what is periodic seems to last."""
    problem = found.problem
    loud = replace(problem.noise_level, correlated=5.0 * problem.noise_level.total)
    budget = misfit_budget(replace(found, problem=replace(problem, noise_level=loud)), CAUSES)
    assert budget.noise == pytest.approx(problem.noise_level.total, rel=0.1)


def test_the_remainder_is_what_smoothing_the_misfit_leaves_of_it(found: Search) -> None:
    """A wave that no cause makes comes out with its root mean square; without a remainder there is none."""
    problem = found.problem
    way = problem.middle().displacement
    wave = 8.0 * problem.noise_level.total * np.cos(5.0 * np.pi * way / way.max())
    fitted = fit(problem, CAUSES, len(SIZES) - 1)
    moved = replace(problem, force=fitted.force + fitted.doubt + wave)
    assert remainder_rms(moved, fitted) == pytest.approx(np.sqrt(np.mean(wave**2)), rel=0.05)
    # What is put down to the doubt about a cause's form is no remainder.
    doubted = replace(fitted, doubt=fitted.doubt + wave)
    assert remainder_rms(moved, doubted) < 0.05 * np.sqrt(np.mean(wave**2))
    assert remainder_rms(moved, replace(fitted, size=0)) == 0.0
