"""The search: a pair looks at every kind of its causes, whatever kind each had taken alone."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from rig import case as rig_case
from rig.effects import shared_form
from rig.recipes import Recipe, Wanted, build_case

from criticism.cases import problem_of, specimen_of
from criticism.found import search
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.climb import Climb, Place
from mpam_calib.criticism.fitting.fit import chain_for, doubt_on_rows, fit
from mpam_calib.criticism.fitting.forms import flexible, forms_of, price
from mpam_calib.criticism.fitting.refits import best_of, with_better_forms, with_doubt, with_doubted_equations
from mpam_calib.criticism.searching import search as procedure
from mpam_calib.criticism.searching.searched import NEAR, POLISHED, Search
from mpam_calib.criticism.tasks.spread import Alone, spread_over
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.specimen import read

PAIR = frozenset({"order_too_low", "stress_softening"})


def hiding(wanted: list[tuple[str, float]], folder: Path) -> Problem:
    """A test that hides these causes, each so many noise sds large (rms)."""
    effects = tuple(Wanted(i, shared_form(i).name, multiple, 1) for i, multiple in wanted)
    recipe = Recipe(
        "kinds", 0, "separable", "tensile", "thumb", "tensile", 5, 3, 2, 1500,
        kinematics="constant_thickness", friction="none", effects=effects,
    )  # fmt: skip
    rig_case.write_case(build_case(recipe), folder / "specimen", folder / "truth.json")
    return problem_of(read(folder / "specimen"))


def test_a_kind_is_looked_for_beside_the_partner(tmp_path: Path) -> None:
    """A wall whose next order is missing, and softening of the whole force (not the wall's stress alone).

    Alone, softening takes what the missing order leaves for a change of the wall's stress; with the partner
    in its place only the true kind needs no bend.
    """
    problem = hiding([("order_too_low", 40.0), ("stress_softening", 8.0)], tmp_path)
    found = search(problem, (*sorted(PAIR), "length_offset", "wall_pressure"))
    assert found.sets[0] == PAIR
    assert found.best_fit(PAIR).effects == {"order_too_low", "stress_softening:force"}


def test_a_set_of_three_leaves_the_kinds_of_its_parts(tmp_path: Path) -> None:
    """Softening of the whole force and a drift, each in a kind that its part took for want of the third."""
    wanted = [("order_too_low", 40.0), ("stress_softening", 8.0), ("force_drift", 8.0)]
    problem = hiding(wanted, tmp_path)
    three, tested = frozenset(i for i, _ in wanted), tuple(i for i, _ in wanted)
    wrong = fit(
        problem,
        frozenset({"order_too_low:bent", "stress_softening:test-bent", "force_drift:settling-bent"}),
        0,
    )
    found = Search(problem, tested, Alone(problem), fits={(three, 0): wrong})
    found.bend_all([(three, 0), (PAIR, 0)])
    assert set(found.fits) == {(three, 0)}
    better = found.fits[three, 0]
    # Of the whole force again, not the test's first cycles alone: bent, or some of it recovering.
    assert better.effects & {"stress_softening:force-bent", "stress_softening:force-recovering"}
    assert better.log_evidence > wrong.log_evidence + 10.0


def test_a_leader_s_causes_keep_their_forms_beside_another(tmp_path: Path) -> None:
    """The true set was seen in a poor form; a leader with a stand-in for the drift has the good one."""
    problem = hiding([("order_too_low", 40.0), ("stress_softening", 8.0), ("force_drift", 8.0)], tmp_path)
    tested = ("order_too_low", "stress_softening", "force_drift", "creep", "length_offset")
    true = frozenset(tested[:3])
    leading = frozenset({"order_too_low:bent", "stress_softening:force-bent", "creep:bent"})
    poor = fit(
        problem, frozenset({"order_too_low:bent", "stress_softening:test-bent", "force_drift:bent"}), 0
    )
    leader = PAIR | {"creep"}
    fits = {(leader, 0): fit(problem, leading, 0), (true, 0): poor}
    found = Search(problem, tested, Alone(problem), fits=fits, polished={(true, 0): True})
    found.swap(leader)
    assert {s for s, _ in found.fits} == {leader} | {
        leader - {e} | {p} for e in leader for p in ("force_drift", "length_offset")
    }
    better = found.fits[true, 0]
    assert "stress_softening:force-bent" in better.effects
    assert better.log_evidence > poor.log_evidence + 10.0
    assert (true, 0) not in found.polished
    # What is better than the swap stays.
    best = replace(better, log_evidence=better.log_evidence + 1.0)
    found.fits[true, 0] = best
    found.swap(leader)
    assert found.fits[true, 0] is best


def test_a_form_found_beside_one_remainder_is_tried_beside_all(tmp_path: Path) -> None:
    """Softening of the whole force was found beside no remainder; beside another the poor form remained."""
    problem = hiding([("order_too_low", 40.0), ("stress_softening", 8.0)], tmp_path)
    good, poor = (
        frozenset({"order_too_low", f}) for f in ("stress_softening:force", "stress_softening:bent")
    )
    single = frozenset({"order_too_low"})
    fits = {
        (PAIR, 0): fit(problem, good, 0),
        (PAIR, 1): fit(problem, poor, 1),
        (single, 1): fit(problem, single, 1),
    }
    kept = replace(fits[PAIR, 1], log_evidence=fits[PAIR, 0].log_evidence - 1.0)
    found = Search(problem, tuple(sorted(PAIR)), Alone(problem), fits=dict(fits))
    found.even_out([PAIR])
    # No set is new, and none beside a remainder that it was not seen beside.
    assert set(found.fits) == set(fits)
    assert found.fits[PAIR, 1].effects == good
    assert found.fits[PAIR, 1].log_evidence > fits[PAIR, 1].log_evidence + 5.0
    assert all(found.fits[key] is fits[key] for key in ((PAIR, 0), (single, 1)))
    # What is better than that stays.
    found.fits[PAIR, 1] = kept
    found.even_out([PAIR])
    assert found.fits[PAIR, 1] is kept


def test_the_search_ends_with_its_leaders_in_one_form_beside_all_remainders(tmp_path: Path) -> None:
    problem = hiding([("order_too_low", 40.0), ("stress_softening", 8.0)], tmp_path)
    good, poor = (
        frozenset({"order_too_low", f}) for f in ("stress_softening:force", "stress_softening:bent")
    )
    found = Search(problem, tuple(sorted(PAIR)), Alone(problem))
    for size in range(len(SIZES)):
        found.refit_all((frozenset(s), size) for k in range(2) for s in combinations(sorted(PAIR), k))
        found.fits[PAIR, size] = fit(problem, good if size == 0 else poor, size)
    assert found.best_size(PAIR) == 0
    procedure._finish(found, 1, lambda share: None)
    forms = {undoubted(found).fits[PAIR, size].effects for size in range(len(SIZES))}
    assert forms == {undoubted(found).fits[PAIR, 0].effects}


def test_beside_two_others_a_cause_has_the_form_that_it_had_beside_one() -> None:
    """Alone, creep of the wall may make up for a bent law of pressure; beside the law it is what it is."""
    problem = problem_of(specimen_of("develop-null-001"))
    forms = [
        ("creep:wall",), ("creep", "law_shape"), ("creep", "stress_softening:force"),
        ("law_shape", "stress_softening:force"),
    ]  # fmt: skip
    fits = {frozenset(form.partition(":")[0] for form in f): fit(problem, frozenset(f), 0) for f in forms}
    best = frozenset({"law_shape", "stress_softening"})
    fits[best] = replace(fits[best], log_evidence=max(f.log_evidence for f in fits.values()) + 1.0)
    tested = ("creep", "law_shape", "stress_softening")
    found = Search(problem, tested, Alone(problem), fits={(s, 0): f for s, f in fits.items()})
    ((tried, start), (again, nothing)) = found._tries(frozenset(tested), 0)
    assert tried == again == ("creep", "law_shape", "stress_softening:force")
    assert "creep_per_decade" in start and nothing == {}


def test_a_larger_set_also_takes_the_forms_that_a_pair_has_beside_the_remainder_that_suits_it() -> None:
    """Without a remainder a pair that still lacks a cause may have ended in forms far from its best ones."""
    problem = problem_of(specimen_of("develop-null-001"))
    pair, single = frozenset({"braid_angle", "tip_shape"}), frozenset({"force_drift"})
    bare = fit(problem, frozenset({"braid_angle", "tip_shape:bent"}), 0)
    held = fit(problem, frozenset({"braid_angle", "tip_shape:power"}), 2)
    held = replace(held, log_evidence=bare.log_evidence + 50.0)
    fits = {(pair, 0): bare, (pair, 2): held, (single, 0): fit(problem, single, 0)}
    tested = ("braid_angle", "force_drift", "tip_shape")
    found = Search(problem, tested, Alone(problem), fits=fits)
    forms = [tried for tried, _ in found._tries(frozenset(tested), 0)]
    alike, better = (("braid_angle", "force_drift", form) for form in ("tip_shape:bent", "tip_shape:power"))
    assert forms == [alike, better, alike]
    assert [tried for tried, _ in found._tries(frozenset(tested), 2)] == [better, better]


@pytest.mark.parametrize("identifier", ["length_offset", "wall_pressure"])
def test_an_equation_that_is_a_little_off_is_not_left_to_a_bend(identifier: str) -> None:
    """A cause whose equation is wrong by some per cent, smoothly: a bend fits better, and says less."""
    problem = problem_of(specimen_of("develop-null-001"))
    key, effects = problem.blueprint.model_dump_json(), frozenset({identifier})
    base = fit(problem, frozenset(), 0)
    climb = Climb(problem, chain_for(key, effects), 0, np.empty((len(problem), 0)))
    u = np.array([base.ended.get(name, 2.0) for name in climb.names])
    values, guide = climb.values(u[None]), climb.guide()
    off = doubt_on_rows(problem, key, effects, values, base.eta, guide)
    true = climb.chain.force(values, base.eta[None], problem.middle())[0]
    true = true + 0.03 * off @ np.random.default_rng(1).normal(size=off.shape[1])
    made = problem.with_force(true + problem.force - base.force)
    with spread_over(made, 1) as spread:
        tasks = [(0, [((form,), {})], False) for form in (f"{identifier}:bent", identifier)]
        bent, equation = (found for found in spread(best_of, tasks) if found is not None)
        doubted_bend, doubted = spread(with_doubt, [bent, equation])
        assert bent.log_evidence > equation.log_evidence
        assert doubted.log_evidence > doubted_bend.log_evidence + 5.0
        (chosen, among_all) = spread(with_doubted_equations, [(bent, False), (bent, True)])
    assert chosen.effects == effects
    assert chosen.log_evidence == pytest.approx(doubted.log_evidence, abs=0.5)
    assert among_all.log_evidence >= chosen.log_evidence


def test_a_climb_is_given_up_only_without_hope(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = problem_of(specimen_of("practice-separable-004", "practice"))
    hidden, poor = (
        frozenset({"braid_kinematics", "pressure_droop"}),
        frozenset({"dead_band", "length_offset"}),
    )
    looks: list[Place] = []
    look = Climb.look

    def counted(self: Climb, *where: np.ndarray) -> Place:
        looks.append(look(self, *where))
        return looks[-1]

    def climbed(effects: frozenset[str], rival: float) -> tuple[float, int]:
        looks.clear()
        return fit(problem, effects, 0, rival=rival).log_evidence, len(looks)

    monkeypatch.setattr(Climb, "look", counted)
    good, bad = (fit(problem, effects, 0) for effects in (hidden, poor))
    assert bad.log_evidence < good.log_evidence - 1000.0
    whole, given_up = climbed(poor, -np.inf), climbed(poor, good.objective)
    assert given_up[1] < whole[1] and given_up[0] <= whole[0] + 0.01
    # What comes near, or is better, is climbed as if there were no rival.
    assert climbed(poor, bad.objective + 20.0) == whole
    assert climbed(hidden, bad.objective)[0] == good.log_evidence


def test_of_the_screened_sets_those_are_bent_that_came_closest(monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines promise, refits decide: an order of promises that is turned round changes nothing."""
    problem = problem_of(specimen_of("develop-null-001"))
    tested = ("force_drift", "length_offset", "pressure_droop", "tip_shape")
    found = Search(problem, tested, Alone(problem))
    found.refit_all((frozenset(s), 0) for k in range(3) for s in combinations(tested, k))
    known = frozenset(tested[:3])
    found.refit(known, 0)
    bent: list[frozenset[str]] = []
    promised = procedure.promising
    monkeypatch.setattr(procedure, "promising", lambda *known: promised(*known)[::-1])
    monkeypatch.setattr(procedure, "BENT", 2)
    monkeypatch.setattr(Search, "bend_all", lambda found, keys: bent.extend(s for s, _ in keys))
    procedure._screen(found, 3)
    triples = set(map(frozenset, combinations(tested, 3)))
    assert triples == {s for s, _ in found.fits if len(s) == 3}
    assert bent == sorted(triples - {known}, key=lambda s: -found.fits[s, 0].log_evidence)[:2]


def undoubted(found: Search) -> Search:
    """The search before the leading sets' forms were doubted."""
    return Search(found.problem, found.tested, found.spread, fits=dict(found.searched))


@pytest.mark.long
def test_no_set_that_comes_near_is_left_in_a_poor_form() -> None:
    """Two causes in equations of other authors, neither the contract's nor bent ones."""
    problem = problem_of(specimen_of("practice-separable-004", "practice"))
    hidden = ("braid_kinematics", "pressure_droop")
    tested = (*hidden, "dead_band", "length_offset", "law_shape", "rig_compliance")
    searched = search(problem, tested)
    # With so few effects every set of three is among those that the screen has refitted.
    assert {s for s in searched.seen if len(s) == 3} == set(map(frozenset, combinations(tested, 3)))
    found = undoubted(searched)
    best = found.score(found.sets[0])
    near = [s for s in found.sets[:POLISHED] if found.score(s) > best - NEAR]
    assert len(near) > 3
    with spread_over(found.problem, 1) as spread:
        fits = [found.best_fit(s) for s in near]
        again = list(spread(with_better_forms, fits))
    for before, after in zip(fits, again, strict=True):
        assert after.log_evidence == pytest.approx(before.log_evidence, abs=0.5), sorted(before.effects)


@pytest.mark.parametrize("identifier", known_effects())
def test_forms_share_one_prior(identifier: str) -> None:
    """The equation as it is written has half of it or more, bent ones a thirtieth."""
    shares = {form: np.exp(-price(form)) for form in forms_of(identifier)}
    assert sum(shares.values()) == pytest.approx(1.0)
    assert shares[identifier] >= 0.5
    apart = {f"{identifier}:{form}" for form in effect(identifier).apart}
    assert apart <= set(flexible(identifier))
    bent = sum(share for form, share in shares.items() if form in set(flexible(identifier)) - apart)
    assert bent == pytest.approx(0.03 if effect(identifier).forms else 0.03 / 0.53)
