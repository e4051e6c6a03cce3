"""The density of a law's rates that the free moduli give, and the search for its modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build
from rig import sets

from criticism.cases import problem_of, specimen_of
from criticism.own_rates import made_with_rates_of_its_own
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.climb import Climb
from mpam_calib.criticism.fitting.fit import chain_for, fit
from mpam_calib.criticism.selection import ranking
from mpam_calib.criticism.selection.rates import Rates, find_rates
from mpam_calib.criticism.selection.space import model_space
from mpam_calib.criticism.tasks.spread import Alone
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import ForceMap

SIZE = 1


@pytest.fixture(scope="module")
def problem() -> Problem:
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "loops")
    return problem_of(specimen_of(recipe.name))


@pytest.fixture(scope="module")
def own() -> Problem:
    return problem_of(made_with_rates_of_its_own())


def plain(problem: Problem, law: str, friction: str = "none", order: int = 3) -> Blueprint:
    simulation = problem.blueprint.simulation.model_copy(
        update={"law": law, "friction": friction, "order": order, "effects": ()}
    )
    return problem.blueprint.model_copy(update={"simulation": simulation})


def rates_of(problem: Problem, law: str, friction: str = "none", order: int = 3) -> Rates:
    blueprint, free = plain(problem, law, friction, order), plain(problem, "free", friction, order)
    chains = (chain_for(b.model_dump_json(), frozenset()) for b in (blueprint, free))
    return Rates(*chains, fit(problem, frozenset(), SIZE, None, free))


def exact(problem: Problem, law: str, rates: np.ndarray) -> float:
    """The log density that a climb itself sees at these rates, everything else at its optimum."""
    climb = Climb(problem, rates_of(problem, law).law, SIZE, np.empty((len(problem), 0)))
    return climb.look(rates, climb.guide(), np.zeros(climb.chain.linear_size)).objective


@pytest.mark.parametrize("law", ["exponential", "exponential_each"])
def test_density_is_the_fit_s_own_where_levels_are_held(problem: Problem, law: str) -> None:
    """With nothing but moduli the Gaussian is exact: all rates are equally far from a climb's density."""
    target = rates_of(problem, law)
    held = replace(problem, readings=replace(problem.readings, pressure=held_pressures(problem)))
    target = replace(target, fit=fit(held, frozenset(), SIZE, None, plain(problem, "free")))
    rates = target.draws(8, seed=1)[-8:]
    off = target.look(rates).objective - np.array([exact(held, law, u) for u in rates])
    np.testing.assert_allclose(off, off[0], atol=1e-4 * np.ptp([exact(held, law, u) for u in rates]) + 1e-3)


def held_pressures(problem: Problem) -> np.ndarray:
    """Every reading's pressure at its level, as the free moduli have it."""
    assert problem.model.setting is not None
    return problem.model.setting.levels[np.concatenate([problem.level, problem.level])]


def test_slopes_are_differences(problem: Problem) -> None:
    """At fixed coefficients of the law (not coordinates, whose prior changes with the rates)."""
    target = rates_of(problem, "exponential_each", "coulomb")
    u, step, d = target.draws(1, seed=2)[-1:], 1e-5, 1
    here = target.look(u)
    coefficients = _coefficients(target, here.coordinates[:, d:], u)
    for i in range(u.shape[1]):
        moved = u + step * np.eye(u.shape[1])[i]
        there = target.look(moved)
        eta = np.linalg.solve(_transform(target, moved), coefficients[..., None])[..., 0]
        force = there.columns @ np.concatenate([here.coordinates[:, :d], eta], axis=1)[..., None]
        before = here.columns @ here.coordinates[..., None]
        change = (force - before)[0, :, 0] / step
        np.testing.assert_allclose(here.slopes[0, :, i], change, atol=1e-3 * np.abs(change).max())


def _transform(target: Rates, u: np.ndarray) -> np.ndarray:
    assert target.law.moduli is not None
    priors = {p.name: p.prior for p in target.law.parameters}
    values = {n: priors[n].from_normal(u[:, i : i + 1]) for i, n in enumerate(target.names)}
    return target.law.moduli.transform(values)[1]


def _coefficients(target: Rates, eta: np.ndarray, u: np.ndarray) -> np.ndarray:
    return (_transform(target, u) @ eta[..., None])[..., 0]


@pytest.mark.parametrize("friction", ["none", "coulomb"])
def test_predicted_evidence_is_the_fit_s(problem: Problem, friction: str) -> None:
    """The Gaussian of the free moduli says within a nat what Laplace then finds, starts included."""
    for law in ("exponential", "exponential_each"):
        target = rates_of(problem, law, friction, order=2)
        best = find_rates(target, None, -np.inf)
        found = fit(problem, frozenset(), SIZE, target.start(best[0]), plain(problem, law, friction, 2))
        assert _evidence(target, best[:1]) == pytest.approx(found.log_evidence, abs=1.0)


def _evidence(target: Rates, rates: np.ndarray) -> float:
    place = target.look(rates)
    both = np.concatenate([place.slopes, place.columns], axis=2)[0]
    hessian = both.T @ both + np.eye(both.shape[1])
    return target.offset + float(place.objective[0]) - 0.5 * float(np.linalg.slogdet(hessian)[1])


def test_a_thorough_search_is_not_beaten_by_many_more_climbs(problem: Problem) -> None:
    """Eight times as many draws, four times as often, are together at most a nat better."""
    target = rates_of(problem, "exponential_each", "coulomb", order=3)
    found = _evidence(target, find_rates(target, None, -np.inf)[:1])
    quick = _evidence(target, find_rates(target, None, np.inf)[:1])
    known = np.concatenate([target.draws(128, seed) for seed in range(4)])
    many = max(
        _evidence(target, find_rates(target, part, -np.inf, seed=9)[:1]) for part in np.array_split(known, 4)
    )
    assert found >= many - 1.0
    assert found >= quick


def test_readings_at_rest_length_say_nothing_of_rates() -> None:
    """Where engineering strain is nothing, and every law is ranked all the same."""
    pressure = 1e5 * np.array([0.5, 1.0, 1.5, 2.0, 2.5])
    none = np.zeros(5, dtype=np.int64)
    made = build.specimen(
        {"law": "linear", "order": 1, "friction": "none"},
        levels_kPa=tuple(pressure / 1e3),
        force_map=ForceMap(pressure, np.zeros(5), 4e-4 * pressure, np.arange(5), none, none.astype(bool)),
    )
    space = [s for s in model_space(made) if s.order == 1 and s.strain == "engineering"]
    ranked = ranking.rank(problem_of(made), space, workers=1)
    assert {r.simulation.law for r in ranked} == {"constant", "linear", "free", "exponential"}
    assert len(ranked) == len(space)


@pytest.mark.parametrize(("off", "again"), [(5.0, True), (2.0 * ranking.NEAR, False)])
def test_only_models_near_the_top_are_searched_again(own: Problem, off: float, again: bool) -> None:
    """A first search that ended badly does not decide the ranking."""
    laws = ("free", "exponential_each")
    free, right = (
        ranking.fitted(own, own.blueprint.simulation.model_copy(update={"law": law})) for law in laws
    )
    assert free is not None
    assert right is not None
    top = max(free.log_evidence, right.log_evidence)
    off += right.log_evidence - top
    bad = replace(
        right,
        fits=[replace(f, log_evidence=f.log_evidence - off) for f in right.fits],
        log_evidence=right.log_evidence - off,
    )
    first = replace(free, log_evidence=top)
    _, found = ranking._searched_again(Alone(own), [first, bad], seed=0)
    assert found.log_evidence == pytest.approx((right if again else bad).log_evidence, abs=0.5)


def test_no_search_has_the_seed_of_another() -> None:
    """Neither a further one of the same ranking nor any of a ranking under another seed."""
    simulation = Simulation(law="exponential_each", order=2)
    own = ranking.Ranked(simulation, [], 0.0)
    seen: list[int] = []

    def spread(function, tasks):
        for before, _, seed in tasks:
            seen.append(seed)
            yield before

    for seed in range(4):
        seen.append((1 + ranking.AGAIN) * seed)  # the first search's
        ranking._searched_again(spread, [own], seed)
    assert len(seen) == len(set(seen)) == 4 * (1 + ranking.AGAIN)
