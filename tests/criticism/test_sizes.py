"""Bands of a cause's size: over all forms that the data do not exclude, by their evidence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.diagnose import _in_lab_units, within_declared
from mpam_calib.criticism.fitting.fit import Fit, Under, chain_for, fit
from mpam_calib.criticism.fitting.forms import forms_of, price
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.sizes import EXCLUDED, Sizes, Told, sizes_of
from mpam_calib.criticism.tasks.spread import Alone
from mpam_calib.model.effect import effect
from mpam_calib.model.model import build_model
from mpam_calib.model.priors import Prior
from mpam_calib.model.state import Setting
from mpam_calib.specimen.declaration import GeometrySd

CAUSE, SIZE_NAME = "creep", "creep_per_decade"
TESTS = 120


def force_with(problem: Problem, start: Fit, forms: str, u: dict[str, float]) -> np.ndarray:
    """The force (n,) of a fitted simulation with effects more ("a" or "a+b"), coordinates as given, N."""
    chain, n = chain_for(problem.blueprint.model_dump_json(), frozenset(forms.split("+"))), len(problem)
    at = start.ended | u
    values = {p.name: p.prior.from_normal(np.full((1, 1), at[p.name])) for p in chain.parameters}
    force = chain.force(values, start.eta[None], problem.readings)[0]
    return np.asarray(0.5 * (force[:n] + force[n:]))


def found_for(problem: Problem) -> Sizes:
    """The sizes of the cause as a search for nothing else ends with them."""
    found = Search(problem, (CAUSE,), Alone(problem))
    found.refit_all([(frozenset(), 0), (frozenset([CAUSE]), 0)])
    found.polish([frozenset([CAUSE])])
    found.doubt(1)
    return sizes_of(found, frozenset([CAUSE]))


def test_draws_weigh_the_forms_by_their_evidence(problem: Problem) -> None:
    """Three to one for the second of two forms, the third without that parameter."""
    assert problem.model.setting is not None
    base = fit(problem, frozenset([CAUSE]), 0)
    d = len(base.names)
    near = replace(base, log_evidence=-900.0, under=(Under(-900.0, np.full(d, -1.0), np.full(d, 1e-3)),))
    far = replace(
        base, effects=frozenset([f"{CAUSE}:power"]), log_evidence=-900.0 + np.log(3.0),
        under=(Under(-900.0, np.full(d, 1.0), np.full(d, 1e-3)),),
    )  # fmt: skip
    none = replace(fit(problem, frozenset(), 0), log_evidence=-800.0)
    draws = Sizes((far, near, none), problem.model.setting).draw(SIZE_NAME, 4000, np.random.default_rng(3))
    (parameter,) = effect(CAUSE).parameters(problem.model.setting)
    low, middle, high = parameter.prior.from_normal(np.array([-1.0, 0.0, 1.0]))
    assert len(draws) == 4000
    assert Sizes((far, near), problem.model.setting).forms(CAUSE) == pytest.approx({"power": 0.75, "": 0.25})
    assert np.mean(draws > middle) == pytest.approx(0.75, abs=0.02)
    assert draws.min() == pytest.approx(low, rel=0.02) and draws.max() == pytest.approx(high, rel=0.02)


def test_what_is_told_of_a_size_is_its_draws_mean_sd_and_quantiles(problem: Problem) -> None:
    """Of a dead-band, which is normal: 1 ± 0.3 of its prior's sds, by draws that are the seed's own."""
    assert problem.model.setting is not None
    base = fit(problem, frozenset(["dead_band"]), 0)
    d = len(base.names)
    known = replace(base, under=(Under(base.log_evidence, np.full(d, 1.0), np.full(d, 0.3)),))
    first, again, other = (
        Sizes((known,), problem.model.setting).told("dead_band", seed)["P_DB_kPa"] for seed in (2, 2, 3)
    )
    (parameter,) = effect("dead_band").parameters(problem.model.setting)
    expected = parameter.prior.from_normal(1.0 + 0.3 * np.array([0.0, -1.645, 1.645]))
    sd = 0.3 * parameter.prior.sd
    assert (first.mean, first.q05, first.q95) == pytest.approx(tuple(expected), abs=0.1 * sd)
    assert first.sd == pytest.approx(sd, rel=0.05)
    assert first == again != other


@pytest.mark.parametrize(("size", "alone"), [(0.05, False), (2.0, True)])
def test_forms_that_the_data_exclude_are_left_out(problem: Problem, size: float, alone: bool) -> None:
    """A small creep may follow any law of time, a large one its own."""
    made = problem.with_force(force_with(problem, fit(problem, frozenset(), 0), CAUSE, {SIZE_NAME: size}))
    sizes = found_for(made)
    first, *others = sizes.fits
    assert first.effects == {CAUSE}
    assert bool(others) != alone
    assert all(f.log_evidence > first.log_evidence - EXCLUDED for f in others)
    assert next(iter(sizes.forms(CAUSE))) == ""


@pytest.mark.long
def test_the_band_of_a_size_covers_whatever_form_was_due(problem: Problem) -> None:
    """Forms drawn as the prior has them, hard to tell apart: the likeliest form by itself is too sure."""
    assert problem.model.setting is not None
    start, rng = fit(problem, frozenset(), 0), np.random.default_rng(3)
    forms = forms_of(CAUSE)
    shares = np.exp([-price(form) for form in forms])
    inside = np.zeros(2, dtype=int)
    for _ in range(TESTS):
        form = forms[rng.choice(len(forms), p=shares / shares.sum())]
        own = effect(form).parameters(problem.model.setting)
        u = {p.name: rng.standard_normal() for p in own} | {SIZE_NAME: 0.3}
        noise = rng.multivariate_normal(np.zeros(len(problem)), problem.covariance(0.0), method="cholesky")
        sizes = found_for(problem.with_force(force_with(problem, start, form, u) + noise))
        target = own[0].prior.from_normal(np.array([0.3]))[0]
        for i, kept in enumerate((sizes, replace(sizes, fits=sizes.fits[:1]))):
            low, high = np.quantile(kept.draw(SIZE_NAME, 4000, rng), [0.05, 0.95])
            inside[i] += low <= target <= high
    print(f"inside {inside[0]} of {TESTS}, by the likeliest form alone {inside[1]}")
    assert inside[0] / TESTS > 0.9 - 3.0 * np.sqrt(0.9 * 0.1 / TESTS)
    assert inside[1] < inside[0]


def test_a_cause_may_have_no_size(problem: Problem) -> None:
    """Another law of the radius has no parameter: it is there or not."""
    setting = problem.model.setting
    assert setting is not None
    found = fit(problem, frozenset({"braid_kinematics"}), 0)
    told = Sizes((found,), setting).told("braid_kinematics", 1)
    assert told == {}
    assert not within_declared("braid_kinematics", told, setting)


@pytest.mark.parametrize(("sds", "within"), [(-1.9, True), (1.9, True), (2.1, False), (-2.1, False)])
def test_a_size_is_held_against_its_declared_sd(problem: Problem, sds: float, within: bool) -> None:
    assert problem.model.setting is not None
    sd = 2e3
    setting = replace(problem.model.setting, pressure_bias_sd=sd)
    told = {"P_DB_kPa": Told(sds * sd, 0.1 * sd, 0.0, 0.0)}
    assert within_declared("dead_band", told, setting) is within
    assert not within_declared("tip_shape", told, setting)


@pytest.mark.parametrize(("degrees", "within"), [(-0.9, True), (1.1, False), (-1.1, False)])
def test_an_angle_is_held_against_the_angle_s_own_sd(problem: Problem, degrees: float, within: bool) -> None:
    """Of half a degree, whatever is declared of the gauge."""
    assert problem.model.setting is not None
    geometry = problem.model.setting.geometry.model_copy(update={"sd": GeometrySd(alpha0_deg=0.5)})
    told = {"delta_alpha_deg": Told(float(np.radians(degrees)), 0.001, 0.0, 0.0)}
    for gauge in (0.0, 1e6):
        setting = replace(problem.model.setting, geometry=geometry, pressure_bias_sd=gauge)
        assert within_declared("braid_angle", told, setting) is within


def test_sizes_are_written_in_the_units_of_their_names() -> None:
    angle = [float(x) for x in np.radians([0.5, 0.1, 0.3, 0.7])]
    found = _in_lab_units({"P_DB_kPa": Told(7.5e3, 500.0, 6.7e3, 8.3e3), "delta_alpha_deg": Told(*angle)})
    assert found["P_DB_kPa"] == pytest.approx({"mean": 7.5, "sd": 0.5, "q05": 6.7, "q95": 8.3})
    assert found["delta_alpha_deg"] == pytest.approx({"mean": 0.5, "sd": 0.1, "q05": 0.3, "q95": 0.7})


@pytest.mark.parametrize(
    ("cause", "name", "size"), [("braid_angle", "delta_alpha_deg", -0.4), ("dead_band", "P_DB_kPa", 0.3)]
)
def test_a_cause_may_be_far_larger_than_its_declared_sd(
    problem: Problem, cause: str, name: str, size: float
) -> None:
    """Who declares an angle or a gauge to be known well may be wrong: ``size`` in sds without that."""
    hidden = force_with(problem, fit(problem, frozenset(), 0), cause, {name: size})
    blueprint = problem.blueprint
    assert blueprint.geometry is not None
    sure = blueprint.model_copy(
        update={
            "geometry": blueprint.geometry.model_copy(update={"sd": GeometrySd(alpha0_deg=0.1)}),
            "sensors": blueprint.sensors.model_copy(update={"pressure_bias_sd_kPa": 0.1}),
        }
    )
    measured = problem.with_force(hidden + problem.force - fit(problem, frozenset(), 0).force)
    assert problem.model.setting is not None
    true = prior_of(cause, problem.model.setting).from_normal(np.array([size]))[0]
    for declared in (blueprint, sure):
        found = fit(measured, frozenset([cause]), 0, blueprint=declared)
        setting = build_model(declared).setting
        assert setting is not None
        value = prior_of(cause, setting).from_normal(found.u[[found.names.index(name)]])[0]
        assert value == pytest.approx(true, rel=0.05)


def prior_of(cause: str, setting: Setting) -> Prior:
    """Of a cause with one parameter."""
    (parameter,) = effect(cause).parameters(setting)
    return parameter.prior
