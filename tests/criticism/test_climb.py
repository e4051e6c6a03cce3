"""The climb's slopes: sizes that act at one level each are moved together, and come out as if one by one.

And its steps, with and without coordinates that are stuck.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.climb import Climb, _damped
from mpam_calib.criticism.fitting.fit import chain_for
from mpam_calib.criticism.fitting.forms import forms_of
from mpam_calib.criticism.searching.candidates import candidates

from .cases import problem_of, specimen_of


@pytest.fixture(scope="module", params=["coulomb", "strand"])
def problem(request: pytest.FixtureRequest) -> Problem:
    """Friction of its own at every level."""
    specimen = specimen_of("develop-separable-028")
    update = {"friction": request.param, "friction_by_pressure": True}
    return problem_of(replace(specimen, simulation=specimen.simulation.model_copy(update=update)))


def climb_of(problem: Problem, form: str) -> Climb:
    chain = chain_for(problem.blueprint.model_dump_json(), frozenset([form]))
    return Climb(problem, chain, 0, np.empty((len(problem), 0)))


def test_sizes_of_one_level_each_are_moved_together_as_if_one_by_one(problem: Problem) -> None:
    levels = len(np.unique(problem.level))
    for form in (form for tested in candidates(problem).tested for form in forms_of(tested)):
        together, apart = climb_of(problem, form), climb_of(problem, form)
        apart.__dict__["_by_level"] = 0
        u = 0.3 * np.random.default_rng(2).standard_normal(len(together.names))
        found, expected = (
            climb.look(u, climb.guide(), np.full(climb.chain.linear_size, 0.1)) for climb in (together, apart)
        )
        assert len(together._offsets) == len(apart._offsets) - levels + 1
        np.testing.assert_allclose(found.moved, expected.moved, rtol=1e-9, atol=1e-12 * problem.force_scale)
        assert found.objective == expected.objective


def test_readings_between_the_levels_feel_the_friction_of_two(problem: Problem) -> None:
    readings = problem.readings
    between = replace(problem, readings=replace(readings, level=np.full_like(readings.level, -1)))
    climb = climb_of(between, "creep")
    assert len(climb._offsets) == 1 + len(climb.names)


@pytest.mark.parametrize("stuck", [[], [1], [0, 2]])
def test_a_stuck_coordinate_takes_no_step_and_the_others_the_best_without_it(stuck: list[int]) -> None:
    rng = np.random.default_rng(8)
    root, gradient = rng.standard_normal((9, 5)), rng.standard_normal(5)
    hessian = root.T @ root + np.eye(5)
    before = hessian.copy(), gradient.copy()
    step = _damped(hessian, gradient, 0.3, np.isin(np.arange(3), stuck))
    free = np.setdiff1d(np.arange(5), stuck)
    damped = hessian + 0.3 * np.diag(np.diagonal(hessian))
    np.testing.assert_allclose(step[free], np.linalg.solve(damped[np.ix_(free, free)], gradient[free]))
    assert np.all(step[stuck] == 0.0)
    np.testing.assert_array_equal(hessian, before[0])
    np.testing.assert_array_equal(gradient, before[1])


def test_a_size_that_no_muscle_has_is_worth_nothing_and_passes_in_silence(problem: Problem) -> None:
    """A fixture that gives so much that the muscle would have turned inside out, before its tips are bent."""
    both = frozenset(["rig_compliance", "tip_shape"])
    climb = Climb(problem, chain_for(problem.declared, both), 0, np.empty((len(problem), 0)))
    u = np.zeros(len(climb.names))
    u[climb.names.index("compliance_mm_per_N")] = 36.0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        place = climb.look(u, climb.guide(), np.zeros(climb.chain.linear_size))
    assert place.objective == -np.inf
