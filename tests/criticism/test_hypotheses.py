"""One hypothesis: its evidence is exact where it must be, its forms are silent at size zero."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from rig import recipes, sets
from scipy import stats

from criticism.cases import null_recipe, problem_of, specimen_of
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import chain_for, fit
from mpam_calib.criticism.fitting.predicted import linearise
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.model.bend import is_bend
from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.specimen import read


def test_one_place_and_the_row_s_bow_are_enough(problem: Problem) -> None:
    """With quite another muscle's curvature the mean over every row is right to a fifth of its noise."""
    chain = problem.model.chain
    assert chain is not None
    n = len(problem)
    readings, first, second = problem.lean
    assert len(readings) < 2 * n
    for u, limit in ((0.0, 0.05), (1.0, 0.2)):
        values = {p.name: p.prior.from_normal(np.full((1, 1), u)) for p in chain.parameters}
        eta = np.full((1, chain.linear_size), u)
        both = chain.force(values, eta, problem.readings)[0]
        lean = chain.force(values, eta, readings)[0]
        difference = 0.5 * (lean[first] + lean[second]) + problem.bow - 0.5 * (both[:n] + both[n:])
        assert np.max(np.abs(difference) / np.sqrt(np.diagonal(problem.noise))) < limit


@pytest.mark.parametrize("size", range(len(SIZES)))
def test_evidence_of_a_linear_hypothesis_is_exact(problem: Problem, size: int) -> None:
    """Without friction the force is linear in the moduli's one factor: a Gaussian marginal in closed form."""
    simulation = problem.blueprint.simulation.model_copy(update={"friction": "none"})
    blueprint = problem.blueprint.model_copy(update={"simulation": simulation})
    found = fit(problem, frozenset(), size, None, blueprint)
    setting = blueprint.setting()
    assert setting is not None
    from mpam_calib.model.model import build_model

    chain = build_model(blueprint).chain
    assert chain is not None
    readings, first, second = problem.lean
    terms = chain.terms({"": np.zeros((1, 1))}, readings)
    fixed = 0.5 * (terms.fixed[0, first] + terms.fixed[0, second]) + problem.bow
    columns = 0.5 * (terms.columns[0, first] + terms.columns[0, second])
    covariance = problem.covariance(SIZES[size]) + columns @ columns.T
    exact = stats.multivariate_normal.logpdf(problem.force, fixed, covariance, allow_singular=False)
    assert found.log_evidence == pytest.approx(exact, abs=1e-5)


def test_forms_are_silent_at_size_zero(problem: Problem) -> None:
    setting = problem.model.setting
    assert setting is not None
    base = problem.model.chain
    assert base is not None
    values = {p.name: p.prior.from_normal(np.zeros((1, 1))) for p in base.parameters}
    eta = np.zeros((1, base.linear_size))
    expected = base.force(values, eta, problem.readings)
    seen = 0
    for identifier in known_effects():
        item = effect(identifier)
        if identifier in ("braid_kinematics", "coulomb_friction") or (
            item.needs_braid and problem.blueprint.braid is None
        ):
            continue
        for form in (identifier, *(f"{identifier}:{name}" for name in item.all_forms)):
            simulation = problem.blueprint.simulation.model_copy(update={"effects": (form,)})
            blueprint = problem.blueprint.model_copy(update={"simulation": simulation})
            changed = blueprint.setting()
            assert changed is not None
            zero = {p.name: np.full((1, 1), 1e-12) for p in effect(form).parameters(changed)}
            force = Chain(changed, base.moduli, False).force(values | zero, eta, problem.readings)
            np.testing.assert_allclose(force, expected, atol=1e-6, err_msg=form)
            seen += 1
    assert seen >= 30


def test_what_cannot_be_tested_is_said(problem: Problem) -> None:
    slow = problem.take(problem.cycle == 1)
    left = dict(candidates(slow).not_tested)
    assert left["stress_softening"] == "one cycle"
    everything = candidates(problem)
    assert not set(everything.tested) & set(dict(everything.not_tested))
    assert f"{problem.blueprint.simulation.friction}_friction" not in everything.tested


def test_static_points_know_no_way_since_a_turn(problem: Problem) -> None:
    """They may have branches, which friction shows in."""
    still = replace(problem, stroke=np.full_like(problem.stroke, -1))
    assert dict(candidates(still).not_tested)["presliding"] == "no loops with both branches"
    other = {"coulomb": "strand_friction", "strand": "coulomb_friction", "none": "coulomb_friction"}
    assert other[still.blueprint.simulation.friction] in candidates(still).tested


def test_all_that_asks_for_times_says_that_a_force_map_has_none(problem: Problem) -> None:
    left = dict(candidates(replace(problem, has_clock=False)).not_tested)
    timed = ("rate_friction", "creep", "force_drift", "stress_softening")
    assert {left[e] for e in timed} == {"no clock in a force map"}


def test_a_force_that_depends_on_itself_is_linearised_as_it_moves() -> None:
    """Moduli that add a newton give way by what a fixture gives, too."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "loops")
    problem = problem_of(specimen_of(recipe.name))
    found = fit(problem, frozenset(["rig_compliance"]), 0)
    chain = chain_for(problem.blueprint.model_dump_json(), found.effects)
    place = list(found.names).index("compliance_mm_per_N")
    u = found.u.copy()
    u[place] = 3.0
    soft = replace(found, u=u)
    values = {q.name: q.prior.from_normal(u[i : i + 1, None]) for i, q in enumerate(chain.parameters)}
    n, d, p = len(problem), len(u), chain.linear_size
    _, J = linearise(problem, soft)
    steps = 1e-3 * np.maximum(np.abs(soft.eta), 1e-3)[:, None] * np.eye(p)
    there, back = (chain.force(values, soft.eta + way * steps, problem.readings) for way in (1.0, -1.0))
    slopes = 0.5 * (there - back) / np.diagonal(steps)[:, None]
    exact = 0.5 * (slopes[:, :n] + slopes[:, n:]).T
    bare = chain.terms(values, problem.readings, chain.force(values, soft.eta[None], problem.readings)[0])
    stiff = 0.5 * (bare.columns[0, :n] + bare.columns[0, n:])
    assert np.abs(stiff - exact).max() > 0.02 * np.abs(exact).max()
    np.testing.assert_allclose(J[:, d : d + p], exact, atol=2e-3 * np.abs(exact).max())


def test_friction_that_is_itself_a_cause_may_turn_over_or_depend_on_speed(problem: Problem) -> None:
    """Where no friction is declared the one that is found may have every property of one that is."""
    simulation = problem.blueprint.simulation.model_copy(update={"friction": "none"})
    blueprint = problem.blueprint.model_copy(update={"simulation": simulation})
    tested = candidates(replace(problem, blueprint=blueprint)).tested
    assert {"coulomb_friction", "presliding"} <= set(tested)
    assert ("rate_friction" in tested) == ("rate_friction" in candidates(problem).tested)


def test_noise_is_found_before_any_model(problem: Problem) -> None:
    truth = recipes.build_case(null_recipe()).protocol
    total = float(np.hypot(truth.noise_N, truth.correlated_N))
    assert problem.noise_level.total == pytest.approx(total, rel=0.3)


DATASETS = Path(__file__).parents[2] / "datasets"


@pytest.mark.parametrize("start", [0.0, 5.2, 7.0])
def test_a_fixture_too_soft_for_the_specimen_is_not_believed(start: float) -> None:
    """A cylinder pulls the harder the more it contracts: beside a soft fixture its force never settles.

    One step of the fixed point looks 280 nats better there than the force that predictions then solve for.
    """
    problem = problem_of(read(DATASETS / "cylinder_zillen"))
    causes = frozenset({"order_too_low", "rig_compliance"})
    try:
        found = fit(problem, causes, 2, {"compliance_mm_per_N": start, "K_f": -1.25, "next_order": 0.4})
    except np.linalg.LinAlgError:
        assert start > 0.0  # no equilibrium from there: refused; a stiff fixture has one
        return
    force, _ = linearise(problem, found)
    assert np.abs(force + problem.bow - found.force).max() < 0.1 * problem.noise_level.total


def test_a_fit_does_not_stay_where_the_force_has_another_sign() -> None:
    """Near full stroke the force passes zero, where Coulomb friction turns round with its sign.

    A place that was judged by the signs of the one before it could look better than any other: from nothing
    this fit once ended 14 nats below the mode.
    """
    problem = problem_of(specimen_of("develop-separable-016"))
    fold = problem.take(problem.level != 3)
    causes = frozenset({"coulomb_friction", "dead_band"})
    near = fit(fold, causes, 0, {"f_s": 0.45, "P_DB_kPa": 0.16, "K_f": -0.5})
    assert fit(fold, causes, 0).log_evidence == pytest.approx(near.log_evidence, abs=0.05)


def test_a_law_far_from_the_declared_one_is_reached(problem: Problem) -> None:
    """Its parameters are sizes, not bends of one: they go as far as any size."""
    effects = frozenset({"law_shape"})
    chain = chain_for(problem.blueprint.model_dump_json(), effects)
    names = [p.name for p in chain.parameters]
    assert [is_bend(n) for n in ("law_bend_1", "law_bend_1_bend_2", "offset_mm_bend_1")] == [
        False,
        True,
        True,
    ]
    u, n = np.zeros(len(names)), len(problem)
    first = next(i for i, name in enumerate(names) if name.startswith("law_bend"))
    u[first] = 3.5
    values = {p.name: p.prior.from_normal(np.full((1, 1), u[i])) for i, p in enumerate(chain.parameters)}
    both = chain.force(values, np.zeros((1, chain.linear_size)), problem.readings)[0]
    found = fit(problem.with_force(0.5 * (both[:n] + both[n:])), effects, 0)
    assert found.u[first] == pytest.approx(3.5, abs=0.3)
    assert found.chi2 < 0.05 * n, "what prior and bow leave"


def test_a_start_that_is_no_muscle_is_refused(problem: Problem) -> None:
    """No force is finite there: a search passes over it, as over every climb that does not end."""
    start = {"tip_factor": float("nan")}
    with pytest.raises(np.linalg.LinAlgError):
        fit(problem, frozenset({"tip_shape"}), 0, start)
