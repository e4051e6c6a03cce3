"""How large the noise is, from what the best set leaves."""

from __future__ import annotations

import numpy as np
import pytest

from criticism.test_evidence import loops_of_a_rig
from criticism.test_hypotheses import problem_of, specimen_of
from mpam_calib.criticism.fit import Fit, fit
from mpam_calib.criticism.noise_scale import noise_scale
from mpam_calib.criticism.problem import SIZES, Problem


def fits(problem: Problem) -> list[Fit]:
    return [fit(problem, frozenset(), size) for size in range(len(SIZES))]


@pytest.fixture(scope="module")
def drawn() -> Problem:
    """Forces that are the declared simulation's, with just the noise that is supposed."""
    problem = problem_of(specimen_of(loops_of_a_rig()))
    noise = np.linalg.cholesky(problem.noise) @ np.random.default_rng(0).standard_normal(len(problem))
    return problem.with_force(fit(problem, frozenset(), 0).force + noise)


@pytest.mark.parametrize("wrong", [0.6, 1.0, 1.5])
def test_noise_that_is_taken_for_too_large_or_too_small_is_put_right(drawn: Problem, wrong: float) -> None:
    supposed = drawn.with_noise_scale(wrong)
    assert supposed.noise_level == drawn.noise_level
    assert wrong * noise_scale(supposed, fits(supposed)) == pytest.approx(1.0, abs=0.07)


def test_smooth_misfit_is_not_taken_for_noise(drawn: Problem) -> None:
    """The remainder holds it: a bump of five times a row's noise, the same in every stroke."""
    x = drawn.middle().displacement
    bump = np.exp(-0.5 * ((x / x.max() - 0.5) / 0.1) ** 2)
    missed = drawn.with_force(drawn.force + 5.0 * np.sqrt(np.median(np.diagonal(drawn.noise))) * bump)
    assert noise_scale(missed, fits(missed)) == pytest.approx(1.0, abs=0.15)
