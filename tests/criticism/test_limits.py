"""How large an effect could be unseen: known posteriors, and sizes hidden by another rig below detection."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from rig import recipes, sets
from rig.effects import form as rig_form
from scipy import integrate, linalg

from mpam_calib.criticism import limits
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.doubt import DOUBTS
from mpam_calib.criticism.fitting.fit import chain_for, fit
from mpam_calib.criticism.limits import NO_ROOM, hidden_sizes
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.criticism.tasks.spread import Alone
from mpam_calib.model.effect import effect
from mpam_calib.specimen import read
from mpam_calib.units import si_factor

from .cases import problem_of, read_case, specimen_of

Array = NDArray[np.float64]

NOTHING: frozenset[str] = frozenset()
DRIFT = frozenset(["force_drift"])

WITHOUT_FRICTION = "develop-null-006"
"""Tensile moduli with one factor, no friction: but for the effect's size the force is linear."""


@pytest.fixture(scope="module")
def problem() -> Problem:
    found = problem_of(specimen_of(WITHOUT_FRICTION))
    assert found.model.chain is not None
    assert not found.model.chain.parameters
    return found


def log_likelihood(problem: Problem, identifier: str, x: Array, beside: frozenset[str] = NOTHING) -> Array:
    """Of sizes (k,), the moduli's factor integrated out in closed form: normal, by dense algebra.

    So is the size of an effect ``beside``, in which the force is linear.
    """
    chain = chain_for(problem.blueprint.model_dump_json(), beside | {identifier})
    readings, first, second = problem.lean
    (own,) = effect(identifier).parameters(problem.model.setting)
    others = [p for p in chain.parameters if p.name != own.name]
    found = []
    for size in x:

        def on_rows(u: float, size: float = size) -> tuple[Array, Array]:
            values = {p.name: p.prior.from_normal(np.full((1, 1), u)) for p in others}
            terms = chain.terms(values | {own.name: np.full((1, 1), size)}, readings)
            return tuple(0.5 * (t[0, first] + t[0, second]) for t in (terms.fixed, terms.columns))

        fixed, columns = on_rows(0.0)
        if others:
            columns = np.column_stack([columns, (on_rows(1e-3)[0] - fixed) / 1e-3])
        fixed = fixed + problem.bow
        factor = linalg.cholesky(problem.covariance(0.0) + columns @ columns.T, lower=True)
        white = linalg.solve_triangular(factor, problem.force - fixed, lower=True)
        found.append(-0.5 * white @ white - np.sum(np.log(np.diagonal(factor))))
    return np.array(found)


@pytest.mark.parametrize(
    "identifier",
    [
        "length_offset",
        "braid_stretch",
        *(pytest.param(e, marks=pytest.mark.long) for e in ("force_drift", "pressure_droop")),
    ],
)
def test_the_band_is_that_of_the_known_posterior(problem: Problem, identifier: str) -> None:
    """Of either sign, and of one: there the density falls off a cliff at nothing."""
    kinds = (f"{identifier}:{kind}" for kind in effect(identifier).kinds)
    low, high = hidden_sizes(problem, [identifier], fit(problem, NOTHING, 0))[identifier]
    width = high - low
    bands = []
    for form in (identifier, *kinds):
        (parameter,) = effect(form).parameters(problem.model.setting)
        # Far beyond the band on both sides, or down to a hundredth of it where there is but one sign.
        ends = np.array([low - 2.0 * width if low < 0.0 else 0.01 * low, high + 2.0 * width])
        u = np.linspace(*parameter.prior.to_normal(ends), 300)
        x = parameter.prior.from_normal(u)
        log_density = log_likelihood(problem, form, x) - 0.5 * u**2
        density = np.exp(log_density - log_density.max())
        mass = integrate.cumulative_trapezoid(density, u, initial=0)
        bands.append(np.interp([0.05, 0.95], mass / mass[-1], x))
    expected = np.min(bands, axis=0)[0], np.max(bands, axis=0)[1]
    assert (low, high) == pytest.approx(expected, abs=0.03 * (expected[1] - expected[0]))


def test_nothing_is_inside_where_nothing_is_hidden() -> None:
    """Sizes that may have either sign, four muscles of another rig."""
    inside = []
    for name in [r.name for r in sets.recipes("develop") if r.group == "null"][:4]:
        found = problem_of(specimen_of(name))
        bands = hidden_sizes(found, candidates(found).tested, fit(found, NOTHING, 0)).values()
        inside += [low < 0.0 < high for low, high in bands if low < 0.0 or high < 0.0]
    assert len(inside) >= 30
    assert np.mean(inside) >= 0.85


PAIRS = {
    "develop-separable-016": "dead_band",
    "develop-separable-019": "force_drift",
    "develop-separable-037": "force_drift",
}
"""Cases of two causes, both of shared forms, and the one of these that may have either sign."""


def truth_of(name: str) -> tuple[str, ...]:
    return recipes.build_case(next(r for r in sets.recipes("develop") if r.name == name)).ids


@pytest.mark.long
def test_beside_causes_that_are_named_nothing_further_is_seen_but_what_is_there() -> None:
    """Beside both hidden causes no band says that there is more; beside one of them the other's does."""
    inside = []
    for name, signed in PAIRS.items():
        found = problem_of(specimen_of(name))
        tested, truth = candidates(found).tested, frozenset(truth_of(name))
        both = hidden_sizes(found, tested, fit(found, truth, 0, doubts=DOUBTS))
        assert not truth & both.keys()
        inside += [low < 0.0 < high for low, high in both.values() if low < 0.0 or high < 0.0]
        one = hidden_sizes(found, tested, fit(found, truth - {signed}, 0, doubts=DOUBTS))
        low, high = one[signed]
        assert low > 0.0 or high < 0.0, (name, signed)
    assert len(inside) >= 20
    assert np.mean(inside) >= 0.85


@pytest.mark.parametrize("identifier", ["length_offset", "braid_stretch"])
def test_the_band_beside_a_named_cause_is_that_of_the_known_posterior(
    problem: Problem, identifier: str
) -> None:
    """The named one, a drift, is integrated out by dense algebra: the force is linear in it."""
    low, high = hidden_sizes(problem, [identifier], fit(problem, DRIFT, 0))[identifier]
    (parameter,) = effect(identifier).parameters(problem.model.setting)
    ends = np.array([low - (high - low), high + (high - low)])
    u = np.linspace(*parameter.prior.to_normal(ends), 200)
    x = parameter.prior.from_normal(u)
    log_density = log_likelihood(problem, identifier, x, beside=DRIFT) - 0.5 * u**2
    density = np.exp(log_density - log_density.max())
    mass = integrate.cumulative_trapezoid(density, u, initial=0)
    expected = np.interp([0.05, 0.95], mass / mass[-1], x)
    assert (low, high) == pytest.approx(tuple(expected), abs=0.03 * (expected[1] - expected[0]))


@pytest.mark.long
@pytest.mark.parametrize(("share", "least"), [(0.03, 13), (0.1, 13)])
def test_small_sizes_of_another_rig_are_inside(share: float, least: int) -> None:
    """One cause whose form is shared, at a small share of its size: nine bands in ten hold it."""
    inside = []
    for recipe in (*sets.recipes("develop"), *sets.recipes("practice")):
        one = recipes.build_case(recipe)
        if len(one.hidden) != 1 or one.outside:
            continue
        (hidden,) = one.hidden
        form = rig_form(hidden.id, hidden.form)
        if not form.shared or form.parameter in ("", "next_order"):
            continue
        small = replace(one, hidden=(replace(hidden, size=share * hidden.size),))
        found = problem_of(read_case(small))
        bands = hidden_sizes(found, [hidden.id], fit(found, NOTHING, 0))
        if hidden.id in bands:
            low, high = np.array(bands[hidden.id]) / si_factor(form.parameter)
            inside.append(low <= share * hidden.size <= high)
    assert len(inside) >= 15
    assert sum(inside) >= least, inside


def test_what_moves_no_reading_has_no_band(problem: Problem) -> None:
    """Without friction there is nothing that presliding could round off."""
    named = fit(problem, NOTHING, 0)
    assert set(hidden_sizes(problem, ("presliding", "length_offset"), named)) == {"length_offset"}


def test_the_band_of_an_effect_holds_those_of_all_its_kinds_that_are_in_play(problem: Problem) -> None:
    """A drift that settles is four nats behind the steady one; that of a cell tared anew is six."""
    made = {
        "force_drift": (-20.0, (-1.0, 2.0)),
        "force_drift:settling": (-24.0, (-3.0, 1.0)),
        "force_drift:tared": (-26.0, (-9.0, 9.0)),
        "length_offset": (-50.0, (0.5, 0.6)),
        "wall_pressure": None,
    }

    def spread(function: object, tasks: list[tuple[object, object, str]]) -> list[Any]:
        return [made[kind] for *_, kind in tasks]

    named = fit(problem, NOTHING, 0)
    found = hidden_sizes(problem, ("force_drift", "length_offset", "wall_pressure"), named, spread)
    assert found == {"force_drift": (-3.0, 2.0), "length_offset": (0.5, 0.6)}


def test_a_kind_that_the_data_have_no_room_for_counts_only_where_all_are_so(problem: Problem) -> None:
    none = (-np.inf, NO_ROOM)
    made = {"force_drift": none, "force_drift:settling": (-24.0, (-3.0, 1.0)), "length_offset": none}

    def spread(function: object, tasks: list[tuple[object, object, str]]) -> list[Any]:
        return [made.get(kind) for *_, kind in tasks]

    found = hidden_sizes(problem, ("force_drift", "length_offset"), fit(problem, NOTHING, 0), spread)
    assert found == {"force_drift": (-3.0, 1.0), "length_offset": NO_ROOM}


@pytest.fixture(scope="module")
def turned_at_once() -> Problem:
    """Nothing hidden; each stroke begins with a reading at the very turn that is on its own side already."""
    specimen = specimen_of("develop-null-000")
    table = pd.read_csv(specimen.folder / "loops.csv")
    strokes = table.groupby((table["branch"] != table["branch"].shift()).cumsum())
    ahead = ["time_s", "displacement_mm", "force_N"]
    rows = []
    for _, stroke in strokes:
        first, second = stroke[ahead].to_numpy()[:2]
        turn = stroke.iloc[[0]].copy()
        turn[ahead] = first - 0.5 * (second - first)  # half a step ahead of it
        rows += [turn, stroke]
    pd.concat(rows).to_csv(specimen.folder / "loops.csv", index=False)
    return problem_of(read(specimen.folder))


def test_a_size_that_is_better_than_its_neighbours_alone_is_no_size_that_could_hide(
    turned_at_once: Problem,
) -> None:
    """Any presliding that is long enough to be looked at holds a reading at the turn on the old side."""
    found = hidden_sizes(turned_at_once, ["presliding"], fit(turned_at_once, NOTHING, 0))
    assert found == {"presliding": NO_ROOM}


def test_a_kind_whose_sizes_are_known_narrowly_is_not_left_out_for_that(problem: Problem) -> None:
    """Readings without creep: those of the whole force tell it far more exactly than the bladder's alone."""
    nothing = fit(problem, NOTHING, 0)
    problem = replace(problem, force=nothing.force)
    named = fit(problem, NOTHING, 0)
    tasks = [(named, np.zeros((len(problem), 0)), -np.inf, kind) for kind in ("creep", "creep:wall")]
    (whole, (low, high)), (bladder, (lowest, highest)) = Alone(problem)(limits._band, tasks)
    assert high - low < 0.2 * (highest - lowest)
    assert whole == pytest.approx(bladder, abs=1.0)
