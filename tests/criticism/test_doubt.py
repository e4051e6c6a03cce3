"""A doubt about a cause's form: it takes up what the equation gets wrong, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from rig import sets

from criticism.test_hypotheses import problem_of, specimen_of
from mpam_calib.criticism.doubt import DOUBTS
from mpam_calib.criticism.fit import Fit, chain_for, doubt_columns, fit
from mpam_calib.criticism.problem import Problem

DOUBT = max(DOUBTS)
CAUSE, SIZE = "length_offset", 0.3
"""The hidden cause and its size in prior sds."""
PASSENGER = "braid_angle"


@pytest.fixture(scope="module")
def problem() -> Problem:
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "tensile")
    return problem_of(specimen_of(recipe.name))


def share(problem: Problem) -> np.ndarray:
    """What the cause does to the force of the fitted simulation (n,), N."""
    start = fit(problem, frozenset(), 0)
    key, n = problem.blueprint.model_dump_json(), len(problem)
    forces = []
    for effects, u in ((frozenset([CAUSE]), SIZE), (frozenset(), 0.0)):
        chain = chain_for(key, effects)
        at = dict(zip(start.names, start.u, strict=True))
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
        at = dict(zip(found.names, found.u, strict=True))
        values = {p.name: p.prior.from_normal(np.full((1, 1), at.get(p.name, u))) for p in chain.parameters}
        key = problem.blueprint.model_dump_json()
        guide = np.full(len(readings), 10.0)
        columns = doubt_columns(key, frozenset([CAUSE]), values, found.eta, readings, guide)
        return float(np.linalg.norm(columns))

    assert size(0.0) < 1e-9
    assert size(0.02) == pytest.approx(2.0 * size(0.01), rel=0.05)
