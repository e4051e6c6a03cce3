"""Other authors' equations: nothing at size zero, finite at odd shapes, near the effect's own in mid-data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.model.effect import effect, known_effects
from mpam_calib.model.readings import Readings
from mpam_calib.model.state import Setting
from mpam_calib.specimen.effect_ids import forms_of_id
from mpam_calib.units import si_factor, unit_of

from .forms import LEVELS, SPEED, force, middle, rows, setting_for, without

FORMS = sorted(f"{e}:{form}" for e in known_effects() for form in effect(e).sources)
SHAPED = [f for f in FORMS if f.partition(":")[2] in effect(f.partition(":")[0]).own]
AWAY = {
    # Friction is as declared at the mean speed, and a law as declared in the middle.
    "rate_friction": {"speed": 4.0 * SPEED, "pace": 4.0 * SPEED},
    "law_shape": {"pressure": 1e3 * LEVELS[-1]},
    # Half-way a fit to all strains may leave nothing; most it leaves beyond them.
    "order_too_low": {"displacement": 0.011},
    # After a turn a supply has hardly anything to refill; a droop is stated for full stroke.
    "pressure_droop": {"travel": 5e-3, "displacement": 5.5e-3},
}


def drawn(form: str, setting: Setting, size: float, shape: float) -> dict[str, np.ndarray]:
    """Values with the effect's own parameters and those of the form at so many prior sds."""
    item, (identifier, _, name) = effect(form), form.partition(":")
    sizes = {p.name for p in effect(identifier).parameters(setting)}
    own = {p.name for p in effect(identifier).own.get(name, lambda setting: ())(setting)} - sizes
    return {
        p.name: p.prior.from_normal(np.full((1, 1), shape if p.name in own else size))
        for p in item.parameters(setting)
    }


def test_every_effect_has_other_authors_forms() -> None:
    assert {form.partition(":")[0] for form in FORMS} == set(known_effects())


@pytest.mark.parametrize("form", FORMS)
def test_a_form_says_what_it_is_and_may_be_declared(form: str) -> None:
    identifier, _, name = form.partition(":")
    base, item, setting = effect(identifier), effect(form), setting_for(form)
    assert name in forms_of_id(identifier) and name in base.forms and name not in base.kinds
    assert set(base.own) <= set(base.sources)
    assert item.source == base.sources[name]
    shared, all_names = ([p.name for p in i.parameters(setting)] for i in (base, item))
    own = base.own[name](setting) if name in base.own else ()
    assert len(own) <= (len(setting.levels) if name.removeprefix("wall-") in base.apart else 2)
    kept = shared[: base.leading.get(name)]
    assert all_names == [*kept, *(p.name for p in own if p.name not in kept)]
    assert all(p.meaning for p in item.parameters(setting))
    for parameter in own:
        assert (parameter.unit == "") == (unit_of(parameter.name) == "")
        assert np.isfinite(parameter.prior.sd) and si_factor(parameter.name) > 0.0


@pytest.mark.parametrize("law", ["constant", "linear"])
@pytest.mark.parametrize("form", [f for f in FORMS if not f.startswith("braid_kinematics")])
def test_at_size_zero_a_form_changes_nothing(form: str, law: str) -> None:
    setting = setting_for(form, law)
    readings = rows(setting)
    # Turning over within no travel at all is the limit of presliding.
    zero = 1e-12 if form.startswith("presliding") else 0.0
    sizes = {p.name: np.full((1, 1), zero) for p in effect(form.partition(":")[0]).parameters(setting)}
    bare = force(without(setting), {}, readings)
    for shape in (-1.0, 0.0, 1.0):
        values = drawn(form, setting, 0.5, shape)
        same = force(setting, {**values, **sizes}, readings)
        np.testing.assert_allclose(same, bare, rtol=1e-11, atol=1e-9)
        assert np.max(np.abs(force(setting, values, readings) - bare)) > 1e-3


@pytest.mark.parametrize("form", [f for f in FORMS if effect(f).parameters(setting_for(f))])
def test_many_parameter_vectors_at_once_are_each_alone(form: str) -> None:
    setting = setting_for(form)
    readings = rows(setting)
    alone = [drawn(form, setting, size, shape) for size, shape in ((0.3, -1.0), (0.6, 0.0), (0.1, 1.2))]
    together = {name: np.concatenate([v[name] for v in alone]) for name in alone[0]}
    expected = np.concatenate([force(setting, values, readings) for values in alone])
    # A fixture's fixed point is stopped at a micronewton.
    np.testing.assert_allclose(force(setting, together, readings), expected, rtol=1e-10, atol=2e-6)


@pytest.mark.parametrize("shape", [-4.0, -2.0, 2.0, 4.0])
@pytest.mark.parametrize("form", SHAPED)
def test_a_form_is_finite_at_odd_shapes(form: str, shape: float) -> None:
    setting = setting_for(form)
    for size in (-1.0, 1.0):
        found = force(setting, drawn(form, setting, size, shape), rows(setting))
        assert np.all(np.isfinite(found))
    at_rest = Readings.at_rest(np.array([0.0, setting.top_pressure]), np.array([0.0, setting.stroke]))
    assert np.all(np.isfinite(force(setting, drawn(form, setting, 1.0, shape), at_rest)))


@pytest.mark.parametrize("form", SHAPED)
def test_a_form_is_smooth_in_its_shape(form: str) -> None:
    """Halving a step halves what it changes, at the median as well as beside it."""
    setting = setting_for(form)
    readings = rows(setting)
    for shape in (-0.7, 0.0, 0.7):
        at, near, far = (
            force(setting, drawn(form, setting, 0.5, shape + step), readings) for step in (0.0, 1e-4, 2e-4)
        )
        change = np.max(np.abs(far - at))
        assert np.max(np.abs(far - 2.0 * near + at)) < 0.02 * change + 1e-5


@pytest.mark.parametrize("form", SHAPED)
def test_each_shape_moves_the_force_as_far_as_two_sds(form: str) -> None:
    """Where one is cut off, a climb that came there would never leave."""
    (identifier, _, name), setting = form.partition(":"), setting_for(form, "linear")
    readings, others = rows(setting), drawn(form, setting, 0.5, 0.5)
    readings = replace(readings, level=np.arange(len(readings)) % len(LEVELS))
    for parameter in effect(identifier).own[name](setting):
        places = np.array([[-2.0], [-1.9], [-0.05], [0.05], [1.9], [2.0]])
        values = {n: np.repeat(v, len(places), axis=0) for n, v in others.items()}
        found = force(setting, values | {parameter.name: parameter.prior.from_normal(places)}, readings)
        moved = np.abs(np.diff(found, axis=0)).max(axis=1)[::2]
        assert np.all(moved > 1e-4 * moved.max()), (parameter.name, moved)


@pytest.mark.parametrize("form", FORMS)
def test_a_form_starts_near_the_effect_s_own_equation(form: str) -> None:
    """At its median shape, in the middle of the data: a climb may start from the plain form's size."""
    (identifier, _, name), setting = form.partition(":"), setting_for(form)
    readings = middle(setting, **AWAY.get(identifier, {}))
    kind = name.rpartition("-")[0]
    plain = setting_for(f"{identifier}:{kind}" if kind else identifier)
    values = drawn(form, setting, 0.5, 0.0)
    unused = {p.name: np.zeros((1, 1)) for p in effect(identifier).parameters(setting)}
    bare = force(without(setting), {}, readings)
    own, other = (float(force(s, unused | values, readings)[0, 0] - bare[0, 0]) for s in (plain, setting))
    assert abs(own) > 1e-3
    assert 0.5 <= other / own <= 2.0


@pytest.mark.parametrize(
    "form",
    [
        "length_offset:slip",
        "length_offset:settling",
        "length_offset:bedding",
        "pressure_droop:speed",
        "pressure_droop:lagging",
        "pressure_droop:volume",
        "pressure_droop:refill",
    ],
)
def test_a_form_with_a_memory_says_so(form: str) -> None:
    assert effect(form).memory and not effect(form.partition(":")[0]).memory


@pytest.mark.parametrize(
    ("identifier", "share", "other"),
    [("order_too_low", "steady_share", "steady"), ("length_offset", "scale_share", "scale")],
)
def test_a_line_is_the_effect_at_one_end_and_another_form_at_the_other(
    identifier: str, share: str, other: str
) -> None:
    setting = setting_for(identifier, "linear")
    readings = rows(setting)
    sizes = drawn(identifier, setting, 0.5, 0.0)

    def at(form: str, **more: np.ndarray) -> np.ndarray:
        return force(
            setting_for(f"{identifier}:{form}" if form else identifier, "linear"), sizes | more, readings
        )

    for value, form in ((0.0, ""), (1.0, other)):
        np.testing.assert_allclose(at("line", **{share: np.full((1, 1), value)}), at(form), rtol=1e-12)
    half = at("line", **{share: np.full((1, 1), 0.5)})
    assert np.max(np.abs(half - at(""))) > 1e-3 and np.max(np.abs(half - at(other))) > 1e-3
