"""A doubt about a cause's form: it takes up what the equation gets wrong, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig import sets

from criticism.cases import problem_of, specimen_of
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.doubt import DOUBTS
from mpam_calib.criticism.fitting.fit import Fit, Under, by_equations, chain_for, doubt_columns, fit

DOUBT = max(DOUBTS)
CAUSE, SIZE = "length_offset", 0.3
"""The hidden cause and its size in prior sds."""
PASSENGER = "braid_angle"
EACH = 60
"""Tests made for every doubt."""


def share(problem: Problem) -> np.ndarray:
    """What the cause does to the force of the fitted simulation (n,), N."""
    start = fit(problem, frozenset(), 0)
    key, n = problem.blueprint.model_dump_json(), len(problem)
    forces = []
    for effects, u in ((frozenset([CAUSE]), SIZE), (frozenset(), 0.0)):
        chain = chain_for(key, effects)
        at = start.ended
        values = {p.name: p.prior.from_normal(np.full((1, 1), at.get(p.name, u))) for p in chain.parameters}
        force = chain.force(values, start.eta[None], problem.readings)[0]
        forces.append(0.5 * (force[:n] + force[n:]))
    return np.asarray(forces[0] - forces[1])


def with_cause(problem: Problem, wrong: float) -> Problem:
    """The cause hidden in the rows, its form off by a share ``wrong`` that changes sign along the stroke."""
    assert problem.model.setting is not None
    x = problem.middle().displacement / problem.model.setting.stroke
    bent = 1.0 + wrong * np.sin(2.0 * np.pi * x)
    return problem.with_force(problem.force + share(problem) * bent)


def lead_of_passenger(problem: Problem, doubts: tuple[float, ...]) -> float:
    """Nats by which the passenger beside the cause does better than the cause alone."""
    alone, beside = (
        fit(problem, frozenset(s), 0, {"offset_mm": SIZE}, doubts=doubts)
        for s in ([f"{CAUSE}:bent"], [f"{CAUSE}:bent", PASSENGER])
    )
    return beside.log_evidence - alone.log_evidence


def test_a_passenger_that_mends_a_form_loses_its_lead(problem: Problem) -> None:
    """A form that is off by a multiple of the doubt makes a passenger; the doubt takes its lead."""
    made = with_cause(problem, 3.0 * DOUBT)
    plain, doubted = lead_of_passenger(made, ()), lead_of_passenger(made, DOUBTS)
    assert plain > 5.0
    assert doubted < -2.0
    found = fit(made, frozenset([f"{CAUSE}:bent"]), 0, {"offset_mm": SIZE}, doubts=DOUBTS)
    assert found.doubt_sd > 0.0 and found.doubt.any()


def test_where_the_form_holds_nothing_is_doubted_away(problem: Problem) -> None:
    """Where the equation is the real one, no passenger gains, and the equation is taken at its word."""
    made = with_cause(problem, 0.0)
    assert lead_of_passenger(made, DOUBTS) < -2.0
    found = fit(made, frozenset([CAUSE]), 0, {"offset_mm": SIZE}, doubts=DOUBTS)
    assert found.doubt_sd == 0.0 and not found.doubt.any()
    assert found.u[found.names.index("offset_mm")] == pytest.approx(SIZE, abs=0.1 * SIZE)


def test_every_doubt_has_an_equal_say(problem: Problem) -> None:
    """The mean of their evidences: of the same one several times over it is that of the one."""
    effects = frozenset(["dead_band"])
    once, thrice = (fit(problem, effects, 0, doubts=(0.0,) * count) for count in (1, 3))
    assert thrice.log_evidence == pytest.approx(once.log_evidence, abs=1e-9)
    every = fit(problem, effects, 0, doubts=DOUBTS)
    each = np.array([under.log_evidence for under in every.under])
    assert each[0] == pytest.approx(once.log_evidence, abs=1e-9) and len(each) == len(DOUBTS)
    assert np.exp(every.log_evidence - each.max()) == pytest.approx(np.mean(np.exp(each - each.max())))


def test_draws_weigh_the_doubts_by_their_evidence(problem: Problem) -> None:
    """Three to one for the second of two: three of four draws are its own, with its mode and sd."""
    found = fit(problem, frozenset([CAUSE]), 0)
    i, d = found.names.index("offset_mm"), len(found.names)
    one = Under(-900.0, np.zeros(d), np.full(d, 0.5))
    other = Under(-900.0 + np.log(3.0), np.full(d, 8.0), np.full(d, 0.1))
    draws = replace(found, under=(one, other)).draw("offset_mm", 40_000, np.random.default_rng(3))
    far = draws > 4.0
    assert far.mean() == pytest.approx(0.75, abs=0.01)
    assert (draws[far].mean(), draws[far].std()) == pytest.approx((8.0, 0.1), rel=0.02)
    assert draws[~far].std() == pytest.approx(0.5, rel=0.03)
    assert [d.u[i] for d in found.under] == [found.u[i]]


def test_the_band_of_a_size_covers_whatever_doubt_was_due(problem: Problem) -> None:
    """Forms off by each doubt in turn, as the doubt has it: 90 % bands hold the size in nine of ten."""
    start = fit(problem, frozenset(), 0)
    readings, first, second = problem.lean
    key = problem.blueprint.model_dump_json()
    chain = chain_for(key, frozenset([CAUSE]))
    at = start.ended
    values = {p.name: p.prior.from_normal(np.full((1, 1), at.get(p.name, SIZE))) for p in chain.parameters}
    guide = np.full(len(readings), float(problem.force.mean()))
    columns = doubt_columns(key, frozenset([CAUSE]), values, start.eta, readings, guide)
    off = 0.5 * (columns[first] + columns[second])
    rng = np.random.default_rng(8)
    inside = np.zeros(len(DOUBTS), dtype=int)
    for i in range(len(DOUBTS) * EACH):
        wrong = DOUBTS[i % len(DOUBTS)] * off @ rng.standard_normal(off.shape[1])
        noise = rng.multivariate_normal(np.zeros(len(problem)), problem.covariance(0.0), method="cholesky")
        made = problem.with_force(start.force + share(problem) + wrong + noise)
        found = fit(made, frozenset([CAUSE]), 0, {"offset_mm": SIZE}, doubts=DOUBTS)
        low, high = np.quantile(found.draw("offset_mm", 4000, rng), [0.05, 0.95])
        inside[i % len(DOUBTS)] += low <= SIZE <= high
    spread = np.sqrt(0.9 * 0.1 / EACH)
    assert inside.mean() / EACH == pytest.approx(0.9, abs=3.0 * spread / np.sqrt(len(DOUBTS)))
    assert (inside / EACH > 0.9 - 3.0 * spread).all()


def test_a_second_cause_of_its_own_keeps_its_lead(problem: Problem) -> None:
    """What is larger than any doubt about the first cause is not taken up by it."""
    made = with_cause(problem, 0.0)
    rows = made.middle()
    drift = rows.time / rows.time.max() * 6.0 * made.noise_level.total
    made = made.with_force(made.force + drift)
    sets_ = [frozenset([CAUSE]), frozenset([CAUSE, "force_drift"])]
    one, two = (fit(made, s, 0, {"offset_mm": SIZE}, doubts=DOUBTS) for s in sets_)
    assert two.log_evidence > one.log_evidence + 20.0


def test_columns_vanish_with_the_cause(problem: Problem) -> None:
    """At size zero there is nothing to doubt; at twice the size there is twice as much, to the curvature."""
    found: Fit = fit(problem, frozenset(), 0)
    readings, _, _ = problem.lean
    chain = chain_for(problem.blueprint.model_dump_json(), frozenset([CAUSE]))

    def size(u: float) -> float:
        at = found.ended
        values = {p.name: p.prior.from_normal(np.full((1, 1), at.get(p.name, u))) for p in chain.parameters}
        key = problem.blueprint.model_dump_json()
        guide = np.full(len(readings), 10.0)
        columns = doubt_columns(key, frozenset([CAUSE]), values, found.eta, readings, guide)
        return float(np.linalg.norm(columns))

    assert size(0.0) < 1e-9
    assert size(0.02) == pytest.approx(2.0 * size(0.01), rel=0.05)


def test_moduli_that_leaned_on_a_doubt_are_fitted_anew_without_it() -> None:
    """Free moduli and a doubt share what both can hold: alone, the equations leave less than beside it."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "loops")
    problem = problem_of(specimen_of(recipe.name))
    x = problem.middle().displacement / problem.middle().displacement.max()
    made = problem.with_force(problem.force + 0.02 * problem.force_scale * (x - x**2))
    found = fit(made, frozenset(["tip_shape"]), 0, {"tip_factor": 0.5}, doubts=(DOUBT,))
    assert found.doubt_sd == DOUBT
    alone = by_equations(made, found)
    left = [float(np.sum(made.white(made.force - force, 0) ** 2)) for force in (alone, found.force)]
    assert left[0] < left[1]
    plain = fit(made, frozenset(["tip_shape"]), 0)
    np.testing.assert_array_equal(by_equations(made, plain), plain.force)
