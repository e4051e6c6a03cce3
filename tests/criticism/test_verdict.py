"""The rules of the verdict, on searches whose fits are made up."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.criticism import verdict as verdict_module
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.tasks.spread import Alone
from mpam_calib.criticism.unexplained.instrument import NO_RIVAL, Rival
from mpam_calib.criticism.verdict import LISTED, Verdict, judge

CAUSE = frozenset(["length_offset"])
NOTHING: frozenset[str] = frozenset()


@pytest.fixture(scope="module")
def problem(problem: Problem) -> Problem:
    """Something is there to explain: an offset of the force, three times the noise."""
    return problem.with_force(problem.force + 3.0 * problem.noise_level.total)


def search_where_the_cause_leaves(problem: Problem, share: float) -> Search:
    """A search whose cause leads by far and leaves this share of the misfit."""
    found = Search(problem, tuple(CAUSE), Alone(problem))
    for size in range(len(SIZES)):
        nothing = found.fits[NOTHING, size] = fit(problem, NOTHING, size)
        left = share * (problem.force - found.fits[NOTHING, 0].force)
        cause = fit(problem, CAUSE, size)
        evidence = nothing.log_evidence + (300.0 if size == 0 else 0.0)
        found.fits[CAUSE, size] = replace(cause, force=problem.force - left, log_evidence=evidence)
    best = max(f.log_evidence for f in found.fits.values())
    found.fits[CAUSE, 0] = replace(found.fits[CAUSE, 0], log_evidence=best + 100.0)
    return found


def test_a_cause_that_lessens_the_misfit_is_named(problem: Problem) -> None:
    verdict = judge(search_where_the_cause_leaves(problem, 0.1))
    assert (verdict.word, verdict.standing) == ("named", CAUSE)


def test_a_cause_that_leaves_more_than_there_was_is_not(problem: Problem) -> None:
    """However much evidence its doubt has earned it."""
    found = search_where_the_cause_leaves(problem, 1.5)
    assert np.argmax([found.score(s) for s in (NOTHING, CAUSE)]) == 1
    verdict = judge(found)
    assert (verdict.word, verdict.standing) == ("unexplained", NOTHING)
    assert verdict.left


@pytest.mark.parametrize(("size", "word"), [(1.0, "unexplained"), (0.1, "named")])
def test_a_set_whose_residuals_still_depend_on_something_is_not_named(
    problem: Problem, size: float, word: str
) -> None:
    """However far it leads; ``size`` is the swing's amplitude in a reading's noise."""
    found = search_where_the_cause_leaves(problem, 0.1)
    leading = found.fits[CAUSE, 0]
    way = problem.middle().displacement
    swing = size * problem.noise_level.total * np.cos(3.0 * np.pi * way / way.max())
    root = np.linalg.cholesky(problem.noise)
    noise = root @ np.random.default_rng(2).standard_normal(len(problem))
    found.fits[CAUSE, 0] = replace(leading, force=problem.force - noise - swing)
    verdict = judge(found)
    assert verdict.word == word
    assert (verdict.trace is None) == (word == "named")
    if verdict.trace is not None:
        assert verdict.trace.against in ("contraction", "branch")
        assert verdict.trace.size > 0.3 * problem.noise_level.total


def search_beside_a_remainder(problem: Problem, margin: float, misfit: float, left: float = 0.5) -> Search:
    """A search whose cause needs the largest remainder and leads by a margin (nats) beside it.

    ``misfit`` is what the fits leave even so, whitened squares per row, ``left`` the share of the force's
    misfit that the cause leaves.
    """
    largest = len(SIZES) - 1
    found = search_where_the_cause_leaves(problem, left)
    for (effects, size), fitted in list(found.fits.items()):
        evidence = -100.0 * (size < largest) + (margin - found.log_prior(CAUSE)) * (effects == CAUSE)
        found.fits[effects, size] = replace(fitted, log_evidence=evidence, chi2=misfit * len(problem))
    return found


@pytest.mark.parametrize(
    ("margin", "misfit", "stands"),
    [(15.0, 1.0, False), (30.0, 1.0, True), (30.0, 3.0, False), (90.0, 3.0, True)],
)
def test_a_cause_stands_beside_unexplained_structure_only_by_far(
    problem: Problem, margin: float, misfit: float, stands: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And by the further, the more the fits leave beside noise and remainder."""
    found = search_beside_a_remainder(problem, margin, misfit)
    monkeypatch.setattr(verdict_module, "score_beside", scores_of({CAUSE: margin}))
    assert found.score(CAUSE) - found.score(NOTHING) == pytest.approx(margin)
    verdict = judge(found)
    assert (verdict.word, verdict.standing) == ("unexplained", CAUSE if stands else NOTHING)


@pytest.mark.parametrize(("margin", "stands"), [(20.0, False), (30.0, True), (np.nan, False)])
def test_nor_does_it_stand_where_free_strokes_replace_it(
    problem: Problem, margin: float, stands: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = search_beside_a_remainder(problem, 90.0, 1.0)
    monkeypatch.setattr(verdict_module, "score_beside", scores_of({CAUSE: margin}))
    assert judge(found).standing == (CAUSE if stands else NOTHING)


@pytest.mark.parametrize(("left", "stands"), [(0.5, True), (0.65, True), (0.85, False), (0.95, False)])
def test_nor_does_it_stand_where_it_explains_less_than_is_left(
    problem: Problem, left: float, stands: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By mean squares beyond the noise: at most half of them may be left."""
    found = search_beside_a_remainder(problem, 90.0, 1.0, left)
    monkeypatch.setattr(verdict_module, "score_beside", scores_of({CAUSE: 90.0}))
    assert judge(found).standing == (CAUSE if stands else NOTHING)


def scores_of(scores: dict[frozenset[str], float]) -> Callable[[Search, Problem, frozenset[str]], float]:
    """Made-up scores beside free strokes; 0 for the other sets."""
    return lambda found, problem, effects: scores.get(effects, 0.0)


@pytest.mark.parametrize(("margins", "listed", "near"), [(range(20, 31), 5, 0), (range(11), 10, 11)])
def test_others_are_listed_however_far_behind(margins: range, listed: int, near: int) -> None:
    """At least the five likeliest, and those that come near as far as the tenth."""
    behind = {frozenset([f"effect_{m}"]): float(np.exp(-m)) for m in margins}
    verdict = Verdict("named", CAUSE, CAUSE, {CAUSE: 1.0, **behind}, {})
    assert list(verdict.others()) == list(behind)[:listed]
    assert verdict.near() == near


def test_a_likeliest_set_that_does_not_stand_takes_no_other_s_place() -> None:
    behind = {frozenset([f"effect_{m}"]): float(np.exp(-m)) for m in range(9)}
    verdict = Verdict("unexplained", CAUSE, NOTHING, {CAUSE: 1.0, **behind}, {})
    assert list(verdict.others()) == [CAUSE, *behind]


@pytest.mark.parametrize(("gap", "listed"), [(9.0, True), (11.0, False)])
def test_a_further_cause_that_the_data_do_not_exclude_is_listed(
    problem: Problem, gap: float, listed: bool
) -> None:
    """Whatever its prior odds are, and behind however many others."""
    found = search_where_the_cause_leaves(problem, 0.1)
    first = found.fits[CAUSE, 0]
    others = [f"effect_{i}" for i in range(2 * LISTED + 1)]
    for i, other in enumerate([*others, "creep"]):
        behind = gap if other == "creep" else 2.0 + 0.1 * i
        fitted = replace(first, log_evidence=first.log_evidence - behind)
        found.fits[CAUSE | {other}, 0] = fitted
    found.tested = (*CAUSE, "creep")
    verdict = judge(found)
    assert verdict.word == "named"
    assert ((CAUSE | {"creep"}) in verdict.others()) == listed


def behind_by(found: Search, effects: frozenset[str], gap: float) -> None:
    """Move the evidence of a set's fits until the first of all sets leads it by ``gap`` nats."""
    first = max(found.score(s) for s in found.sets if s != effects)
    change = first - gap - found.score(effects)
    for key, fitted in list(found.fits.items()):
        if key[0] == effects:
            found.fits[key] = replace(fitted, log_evidence=fitted.log_evidence + change)


@pytest.fixture
def no_rival(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verdict_module, "instrument_rival", lambda found, leading: NO_RIVAL)


@pytest.mark.usefixtures("no_rival")
@pytest.mark.parametrize(("lead", "word"), [(2.0, "adequate"), (4.0, "ambiguous"), (6.0, "named")])
def test_a_cause_is_named_only_where_it_leads_clearly(problem: Problem, lead: float, word: str) -> None:
    """Odds of 7 do not exclude nothing at all; odds of 55 do, but its lead is short of five nats."""
    found = search_where_the_cause_leaves(problem, 0.1)
    behind_by(found, NOTHING, lead)
    verdict = judge(found)
    assert verdict.word == word
    assert verdict.leading == verdict.standing == (NOTHING if word == "adequate" else CAUSE)
    expected = 1.0 / (1.0 + np.exp(-lead))
    assert verdict.probabilities[CAUSE] == pytest.approx(expected)


@pytest.mark.usefixtures("no_rival")
@pytest.mark.parametrize(("rivals", "word"), [(10, "named"), (20, "ambiguous")])
def test_nor_is_it_where_many_others_together_are_not_improbable(
    problem: Problem, rivals: int, word: str
) -> None:
    """Each 5.5 nats behind: ten are a thirtieth beside the first, twenty a twelfth."""
    found = search_where_the_cause_leaves(problem, 0.1)
    names = [f"effect_{i}" for i in range(rivals)]
    found.tested = (*CAUSE, *names)
    for other in (frozenset({name}) | (CAUSE if i % 2 else NOTHING) for i, name in enumerate(names)):
        found.fits[other, 0] = found.fits[CAUSE, 0]
        behind_by(found, other, 5.5)
    verdict = judge(found)
    assert verdict.word == word
    share = np.exp(-5.5) / (1.0 + rivals * np.exp(-5.5))
    # Half of the others have the cause in them as well.
    assert verdict.marginals["length_offset"] == pytest.approx(1.0 - rivals / 2 * share, abs=1e-9)


@pytest.mark.usefixtures("no_rival")
@pytest.mark.parametrize(("gap", "hidden"), [(5.0, True), (25.0, False)])
def test_an_adequate_simulation_is_told_with_its_own_remainder_and_what_could_hide(
    problem: Problem, gap: float, hidden: bool
) -> None:
    """A set is behind by its prior odds, too: by seven nats here."""
    plain = problem.with_force(problem.force - 3.0 * problem.noise_level.total)
    found = Search(plain, tuple(CAUSE), Alone(plain))
    nothing = [fit(plain, NOTHING, size) for size in range(2)]
    best = max(fitted.log_evidence for fitted in nothing)
    found.fits[NOTHING, 0], cause = nothing[0], fit(plain, CAUSE, 0)
    found.fits[NOTHING, 1] = replace(nothing[1], log_evidence=best + 4.0)
    found.fits[CAUSE, 0] = cause
    behind_by(found, CAUSE, gap)
    verdict = judge(found)
    assert (verdict.word, verdict.leading) == ("adequate", NOTHING)
    assert verdict.unseen == ({CAUSE} if hidden else set())


@pytest.mark.parametrize(
    ("left", "assumed", "word"),
    [
        (0.45, False, "adequate"),
        (0.55, False, "unexplained"),
        (0.95, True, "adequate"),
        (1.05, True, "unexplained"),
    ],
)
def test_a_remainder_counts_from_half_the_noise_on_or_from_all_that_is_assumed(
    problem: Problem, left: float, assumed: bool, word: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = problem.with_force(problem.force - 3.0 * problem.noise_level.total)
    found = Search(replace(plain, noise_guessed=assumed), (), Alone(plain))
    bare, beside = (fit(plain, NOTHING, size) for size in range(2))
    found.fits[NOTHING, 0] = bare
    found.fits[NOTHING, 1] = replace(beside, log_evidence=bare.log_evidence + 9.0)
    share = left * problem.noise_level.total
    monkeypatch.setattr(verdict_module, "remainder_rms", lambda problem, fitted: share)
    monkeypatch.setattr(verdict_module, "instrument_rival", lambda found, leading: NO_RIVAL)
    monkeypatch.setattr(verdict_module, "_standing", lambda found, leading: leading)
    assert judge(found).word == word


@pytest.mark.parametrize(
    ("rival", "word", "standing"),
    [
        (Rival(-6.0, NOTHING), "named", CAUSE),
        (Rival(-4.0, CAUSE), "unexplained", CAUSE),
        (Rival(3.0, NOTHING), "unexplained", NOTHING),
    ],
)
def test_a_load_cell_that_comes_near_takes_the_name_and_what_it_replaces(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, rival: Rival, word: str, standing: frozenset[str]
) -> None:
    found = search_where_the_cause_leaves(problem, 0.1)
    monkeypatch.setattr(verdict_module, "instrument_rival", lambda found, leading: rival)
    monkeypatch.setattr(verdict_module, "_standing", lambda found, leading: leading)
    verdict = judge(found)
    assert (verdict.word, verdict.standing) == (word, standing)
    assert verdict.instrument == (None if word == "named" else rival)
    assert not verdict.left  # by the set that leads


def test_a_part_that_no_climb_can_fit_does_not_end_a_diagnosis(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing is left of it to compare with: the set that leads has no such rival."""
    found = search_where_the_cause_leaves(problem, 0.9)
    pair = CAUSE | {"dead_band"}
    found.tested = tuple(pair)
    for size in range(len(SIZES)):
        before = found.fits[CAUSE, size]
        found.fits[pair, size] = replace(before, log_evidence=before.log_evidence + 60.0)
    kept = found.refit_all

    def refit_all(keys: Iterable[tuple[frozenset[str], int]]) -> None:
        kept(key for key in keys if key[0] != frozenset({"dead_band"}))

    monkeypatch.setattr(found, "refit_all", refit_all)
    assert verdict_module._left(found, frozenset({"dead_band"})) == np.inf
    assert verdict_module._standing(found, pair) <= pair
    assert verdict_module._outweighing(found, pair) <= pair
