"""The density of the rates alone, and the evidence it gives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig import sets

from criticism.cases import problem_of, specimen_of
from criticism.own_rates import made_with_rates_of_its_own
from criticism.test_rates import SIZE, held_pressures, plain, rates_of
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.hypothesis import Hypothesis
from mpam_calib.criticism.selection.rates import Rates, find_rates
from mpam_calib.criticism.selection.rates_alone import RatesAlone, integrate_rates
from mpam_calib.posterior.evidence.quadrature import integrate


@pytest.fixture(scope="module")
def problem() -> Problem:
    return problem_of(made_with_rates_of_its_own())


def hypothesis_at_best(problem: Problem, target: Rates, law: str, friction: str, order: int) -> Hypothesis:
    best = find_rates(target, None, -np.inf)
    blueprint = plain(problem, law, friction, order)
    return Hypothesis(problem, blueprint, fit(problem, frozenset(), SIZE, target.start(best[0]), blueprint))


@pytest.mark.parametrize("law", ["exponential", "exponential_each"])
def test_all_else_is_integrated_out(problem: Problem, law: str) -> None:
    """At any rates: the height that a climb sees, and the volume of all that it left at its optimum."""
    target = rates_of(problem, law, "coulomb")
    rates = target.draws(8, seed=1)[-8:]
    place = target.look(rates)
    across = np.swapaxes(place.columns, 1, 2)
    volume = np.linalg.slogdet(across @ place.columns + np.eye(place.columns.shape[2]))[1]
    expected = target.offset + place.objective - 0.5 * volume - 0.5 * rates.shape[1] * np.log(2.0 * np.pi)
    np.testing.assert_allclose(RatesAlone(target).log_posterior(rates), expected, rtol=1e-7, atol=1e-4)


@pytest.mark.filterwarnings("error")
def test_rates_that_are_far_out_are_impossible_and_no_error(problem: Problem) -> None:
    """Exponentials of hundreds, either way and mixed."""
    alone = RatesAlone(rates_of(problem, "exponential_each", "coulomb"))
    far = 40.0 * np.random.default_rng(0).standard_normal((200, len(alone.target.names)))
    found = alone.log_posterior(far)
    assert not np.any(np.isnan(found))
    assert np.all(found < -1000.0)


@pytest.mark.parametrize(("law", "spread"), [("exponential", 0.1), ("exponential_each", 0.15)])
def test_density_is_the_model_s_own_where_levels_are_held(law: str, spread: float) -> None:
    """With nothing but moduli, log densities in nats about the best rates are the model's own.

    But for what a fit leaves out, which sees a short row by its middle: tenths of a nat where they fall by
    tens. The forces are the free moduli's own with noise: what is left out counts by the misfit.
    """
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "loops")
    problem = problem_of(specimen_of(recipe.name))
    held = replace(problem, readings=replace(problem.readings, pressure=held_pressures(problem)))
    free = plain(problem, "free")
    noise = np.linalg.cholesky(held.covariance(SIZES[SIZE])) @ np.random.default_rng(1).standard_normal(
        len(held)
    )
    held = held.with_force(fit(held, frozenset(), SIZE, None, free).force + noise)
    target = replace(rates_of(held, law), fit=fit(held, frozenset(), SIZE, None, free))
    own = hypothesis_at_best(held, target, law, "none", 3)
    best = np.array([own.fit.u[own.fit.names.index(name)] for name in target.names])
    rates = best + spread * np.random.default_rng(0).standard_normal((20, len(best)))
    exact = own.log_posterior(rates)
    off = RatesAlone(target).log_posterior(rates) - exact
    assert np.std(exact) > 20.0
    assert np.sqrt(np.mean(off**2)) < 0.5
    assert abs(off[np.argmax(exact)]) < 0.1


@pytest.mark.parametrize(("law", "order"), [("exponential_each", 1), ("exponential", 2), ("exponential", 3)])
def test_evidence_is_the_quadrature_s(problem: Problem, law: str, order: int) -> None:
    """Friction and two rates: both agree within a tenth of a nat, and within their errors."""
    target = rates_of(problem, law, "coulomb", order)
    hypothesis = hypothesis_at_best(problem, target, law, "coulomb", order)
    mode = hypothesis.mode()
    exact = integrate(hypothesis, mode)
    assert exact.reliable
    for seed in range(3):
        found = integrate_rates(target, hypothesis, mode, seed)
        assert found is not None
        assert abs(found.value - exact.value) < min(0.1, 3.0 * np.hypot(found.error, exact.error))
        sd = np.sqrt(np.diag(exact.covariance))
        np.testing.assert_allclose((found.mean - exact.mean) / sd, 0.0, atol=0.25)


@pytest.mark.long
def test_seeds_differ_by_no_more_than_their_errors(problem: Problem) -> None:
    """Eight rates, where quadrature does not settle."""
    target = rates_of(problem, "exponential_each", "coulomb", 4)
    hypothesis = hypothesis_at_best(problem, target, "exponential_each", "coulomb", 4)
    mode = hypothesis.mode()
    found = [integrate_rates(target, hypothesis, mode, seed) for seed in range(4)]
    value, error = (np.array([getattr(f, name) for f in found]) for name in ("value", "error"))
    assert value.std(ddof=1) < 2.0 * error.mean()
    assert value.std(ddof=1) < 0.3
    again = integrate_rates(target, hypothesis, mode, 0)
    assert again is not None
    assert again.value == value[0] != value[1]


@pytest.mark.long
def test_a_gaussian_that_is_off_is_corrected_or_given_up(problem: Problem) -> None:
    """The free moduli's covariance half as large again: the same evidence. Their mode far off: none."""
    target = rates_of(problem, "exponential_each", "coulomb", 2)
    hypothesis = hypothesis_at_best(problem, target, "exponential_each", "coulomb", 2)
    mode = hypothesis.mode()
    right = integrate_rates(target, hypothesis, mode)
    wide = replace(target, fit=replace(target.fit, covariance=1.5 * target.fit.covariance))
    corrected = integrate_rates(wide, hypothesis, mode)
    assert right is not None
    assert corrected is not None
    assert abs(corrected.value - right.value) < 3.0 * np.hypot(corrected.error, right.error)
    far = replace(
        target, fit=replace(target.fit, u=target.fit.u + 30.0 * np.sqrt(target.fit.covariance[0, 0]))
    )
    assert integrate_rates(far, hypothesis, mode) is None
