"""Forms of friction, each against the law that it is named after or its equation written out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpam_calib.model.curves import box_cox
from mpam_calib.model.effect import effect

from .forms import (
    SPEED,
    applied,
    chain_of,
    force,
    middle,
    one,
    rows,
    rubbing,
    setting_for,
    shaped,
    start,
    without,
)


@pytest.mark.parametrize(
    ("form", "own", "growth"),
    [
        ("", {}, lambda v, pace: np.log(v)),
        (":stroke", {}, lambda v, pace: np.log(pace)),
        (":power", {"speed_exponent": 1.0}, lambda v, pace: v - 1.0),
        (":power", {"speed_exponent": -1.0}, lambda v, pace: 1.0 - 1.0 / v),
        (":stroke-power", {"speed_exponent": 0.5}, lambda v, pace: 2.0 * (np.sqrt(pace) - 1.0)),
        (
            ":stribeck",
            {"speed_exponent": -0.5, "viscous_share": 0.3},
            lambda v, pace: 2.0 * (1.0 - v**-0.5) + 0.3 * (v - 1.0),
        ),
    ],
)
def test_friction_grows_with_the_speed_over_its_mean(form: str, own: dict[str, float], growth: Any) -> None:
    """By the rate for ten times the speed, near the mean speed, whatever the form; never below none."""
    setting = setting_for("rate_friction")
    state = shaped(setting)
    after = applied(f"rate_friction{form}", state, setting, rate_per_decade=0.2, **own)
    expected = 1.0 + 0.2 * growth(state.readings.speed / SPEED, state.readings.pace / SPEED) / np.log(10.0)
    np.testing.assert_allclose(np.ravel(after.friction_gain), np.maximum(expected, 0.0), rtol=1e-9)


@pytest.mark.parametrize(
    ("form", "own", "growth"),
    [
        ("viscous", {}, lambda v, pace: v),
        ("drag", {"drag_exponent": 0.5}, lambda v, pace: np.sqrt(v)),
        ("stroke-drag", {"drag_exponent": 2.0}, lambda v, pace: pace**2),
    ],
)
def test_a_drag_is_the_same_at_any_force(form: str, own: dict[str, float], growth: Any) -> None:
    """The rate's share of Coulomb's friction at the force scale, by the speed over its mean."""
    setting = setting_for("rate_friction")
    state = shaped(setting)._replace(coulomb=one(0.06))
    after = applied(f"rate_friction:{form}", state, setting, rate_per_decade=0.2, **own)
    unit = 0.2 * 0.06 * setting.force_scale / np.log(10.0)
    expected = unit * growth(state.readings.speed / SPEED, state.readings.pace / SPEED)
    np.testing.assert_allclose(np.ravel(after.drag), expected, rtol=1e-9)
    np.testing.assert_array_equal(after.friction_gain, state.friction_gain)


@pytest.mark.parametrize("exponent", [0.0, -1.0, 2.0])
def test_friction_goes_with_a_power_of_the_contact_s_spread(exponent: float) -> None:
    """1/(RL) along the stroke; at half of it all is as Eq. 2.43 has it."""
    form, shares = "strand_friction:contact", np.array([0.1, 0.5, 0.9])
    setting = setting_for(form)
    length = setting.geometry.L0 - shares * setting.stroke
    strand = setting.geometry.L0 / np.sin(setting.geometry.alpha0)
    spread = 1.0 / (np.sqrt(strand**2 - length**2) * length)
    found = np.array(
        [rubbing(form, s, setting.top_pressure, f_s=0.3, contact_exponent=exponent) for s in shares]
    )
    np.testing.assert_allclose(found / found[1], (spread / spread[1]) ** exponent, rtol=1e-6)
    assert found[1] == pytest.approx(rubbing("strand_friction", 0.5, setting.top_pressure, f_s=0.3))


@pytest.mark.parametrize(
    ("form", "own", "left"),
    [
        ("", {}, lambda y: np.exp(-y)),
        (":ramp", {}, lambda y: np.maximum(1.0 - y, 0.0)),
        (":power", {"reversal_exponent": 0.5}, lambda y: 1.0 - np.sqrt(np.minimum(0.5 * y, 1.0))),
    ],
)
def test_friction_turns_over_after_a_reversal(form: str, own: dict[str, float], left: Any) -> None:
    """From the whole of it against the way to the whole along it, in travel over the reversal's."""
    setting = setting_for("presliding")
    state = shaped(setting, replace(rows(setting), reversal=np.ones(60)))
    reversal = 0.1 * setting.stroke
    after = applied(f"presliding{form}", state, setting, reversal_mm=reversal, **own)
    expected = state.readings.sign * (1.0 - 2.0 * left(state.readings.travel / reversal))
    np.testing.assert_allclose(np.ravel(after.sign), expected, atol=1e-9)


@pytest.mark.parametrize("form", ["", *(f":{name}" for name in effect("presliding").forms)])
def test_a_reversal_that_vanishes_leaves_a_reading_at_the_very_turn_on_its_own_side(form: str) -> None:
    setting = setting_for("presliding")
    state = shaped(setting, replace(rows(setting), reversal=np.ones(60), travel=np.zeros(60)))
    own = {p.name: 1.0 for p in effect(f"presliding{form}").parameters(setting)}
    for share, side in ((1e-7, 1.0), (1.0, -1.0)):
        own["reversal_mm"] = share * setting.stroke
        after = applied(f"presliding{form}", state, setting, **own)
        np.testing.assert_allclose(np.ravel(after.sign), side * state.readings.sign, atol=0.03)


@pytest.mark.parametrize(
    ("form", "built"),
    [
        ("", lambda y: 1.0 - 2.0 * np.exp(-y)),
        (":rest", lambda y: 1.0 - np.exp(-y)),
        (":masing", lambda y: 1.0 - np.exp(-2.0 * y)),
        (":sliding", np.ones_like),
    ],
)
def test_friction_of_a_first_stroke_begins_against_it_at_rest_or_along_it(form: str, built: Any) -> None:
    setting = setting_for("presliding")
    first = replace(rows(setting), reversal=np.zeros(60), cycle=np.ones(60), test_cycle=np.ones(60))
    reversal = 0.1 * setting.stroke
    after = applied(f"presliding{form}", shaped(setting, first), setting, reversal_mm=reversal)
    np.testing.assert_allclose(np.ravel(after.sign), first.sign * built(first.travel / reversal), atol=1e-9)


@pytest.mark.parametrize("form", ["strand_friction:even", "strand_friction:pivoting"])
@pytest.mark.parametrize("exponent", [2.0 / 3.0, 1.0])
def test_friction_may_go_with_another_power_of_the_pressure(form: str, exponent: float) -> None:
    values, levels = {"f_s": 0.3, "strand_exponent": exponent}, setting_for(form).levels
    least = rubbing(form, 0.5, levels[0], **values)
    for pressure in levels:
        expected = least * (pressure / levels[0]) ** exponent
        assert rubbing(form, 0.5, pressure, **values) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("power", [2.0 / 3.0, 1.0])
def test_a_pressed_surface_rubs_all_over(power: float) -> None:
    """Amontons on P·2πRL, or on another power of the pressure, from the strands' geometry alone."""
    form, values = "strand_friction:surface", {"f_s": 0.3, "strand_exponent": power, "contact_exponent": -1.0}
    setting, shares = setting_for(form), np.array([0.1, 0.5, 0.9])
    strand = setting.geometry.L0 / np.sin(setting.geometry.alpha0)
    length = setting.geometry.L0 - shares * setting.stroke
    surface = np.sqrt(strand**2 - length**2) * length
    for pressure in setting.levels:
        found = np.array([rubbing(form, share, pressure, **values) for share in shares])
        at_top = np.array([rubbing(form, share, setting.top_pressure, **values) for share in shares])
        np.testing.assert_allclose(found / found[1], surface / surface[1], rtol=1e-6)
        np.testing.assert_allclose(found / at_top, (pressure / setting.top_pressure) ** power, rtol=1e-9)


def test_adhesion_is_the_same_along_the_stroke() -> None:
    form, values = "strand_friction:even", {"f_s": 0.3, "strand_exponent": 1.0}
    for pressure in setting_for(form).levels:
        there = rubbing(form, 0.1, pressure, **values)
        assert rubbing(form, 0.9, pressure, **values) == pytest.approx(there, rel=1e-9)


@pytest.mark.parametrize("exponent", [1.0, 4.0 / 3.0])
def test_crossings_that_pivot_do_the_work_of_their_moments(exponent: float) -> None:
    """Moments by the load P·2πRL, the crossings' turn 2dα for the way dL, from the geometry alone."""
    form, values = "strand_friction:pivoting", {"f_s": 0.3, "strand_exponent": exponent}
    setting, shares = setting_for(form), np.array([0.1, 0.5, 0.9])
    strand = setting.geometry.L0 / np.sin(setting.geometry.alpha0)
    length = setting.geometry.L0 - shares * setting.stroke
    step = 1e-6 * strand
    turn = (np.arcsin((length + step) / strand) - np.arcsin((length - step) / strand)) / step
    moments = (np.sqrt(strand**2 - length**2) * length) ** exponent * turn
    found = np.array([rubbing(form, share, setting.top_pressure, **values) for share in shares])
    np.testing.assert_allclose(found / found[1], moments / moments[1], rtol=1e-6)


@pytest.mark.parametrize("tension", [5e3, 4e4])
def test_strands_under_the_sleeve_s_tension_rub_as_under_more_pressure(tension: float) -> None:
    """Friction ∝ (P + P0)^(4/3) at one place, whatever the level; without tension it is Eq. 2.43."""
    setting = setting_for("strand_friction:tension")
    levels = np.array([2e4, 8e4, 1.5e5, 3e5])
    at = replace(rows(setting, 4), pressure=levels, displacement=np.full(4, 0.004), sign=np.ones(4))
    bare = force(without(setting), {}, at)

    def at_levels(form: str, **values: float) -> np.ndarray:
        known = {"f_s": one(0.3), **{k: one(v) for k, v in values.items()}}
        return np.ravel(force(setting_for(form), known, at) - bare)

    found = at_levels("strand_friction:tension", sleeve_tension_kPa=tension)
    np.testing.assert_allclose(found / found[0], ((levels + tension) / (levels[0] + tension)) ** (4.0 / 3.0))
    none = at_levels("strand_friction:tension", sleeve_tension_kPa=1e-9)
    np.testing.assert_allclose(none, at_levels("strand_friction"), rtol=1e-9)


def test_dahl_s_law_holds_the_ramp_the_exponential_and_the_hyperbola() -> None:
    setting = setting_for("presliding:dahl")
    readings = replace(rows(setting), reversal=np.ones(60))
    for exponent, left in ((0.0, lambda y: np.maximum(1.0 - y, 0.0)), (1.0, lambda y: np.exp(-y))):
        values = {"reversal_mm": np.array([[1e-3]]), "dahl_exponent": np.array([[exponent]])}
        sign = effect("presliding:dahl").apply(start(setting, readings), values, setting).sign[0]
        expected = readings.sign * (1.0 - 2.0 * left(readings.travel / 1e-3))
        np.testing.assert_allclose(sign, expected, atol=2e-5)
    values["dahl_exponent"] = np.array([[2.0]])
    sign = effect("presliding:dahl").apply(start(setting, readings), values, setting).sign[0]
    np.testing.assert_allclose(sign, readings.sign * (1.0 - 2.0 / (1.0 + readings.travel / 1e-3)))


def test_growth_by_a_power_passes_through_the_logarithm() -> None:
    ratio = np.array([0.1, 0.5, 1.0, 3.0, 40.0])
    np.testing.assert_allclose(box_cox(ratio, np.zeros(1)), np.log(ratio))
    np.testing.assert_allclose(box_cox(ratio, np.ones(1)), ratio - 1.0)
    np.testing.assert_allclose(box_cox(ratio, -np.ones(1)), 1.0 - 1.0 / ratio)


def test_friction_at_any_force_is_chou_and_hannaford_s() -> None:
    setting = setting_for("coulomb_friction:constant")
    values = {"K_f": np.array([[0.1]]), "constant_share": np.array([[1.0]])}
    state = effect("coulomb_friction:constant").apply(start(setting, rows(setting)), values, setting)
    np.testing.assert_allclose(state.coulomb, 0.0, atol=1e-15)
    np.testing.assert_allclose(state.drag, 0.1 * setting.force_scale)


@pytest.mark.parametrize("exponent", [0.6, 1.0, 1.3])
def test_friction_of_fibres_is_a_power_of_the_force(exponent: float) -> None:
    """Howell's law, a·N^n: half the loop's width over half its height, at two places of the stroke."""
    setting = setting_for("coulomb_friction:power")
    values = {"f_s": np.zeros((1, 1)), "K_f": np.array([[1e-3]]), "force_exponent": np.array([[exponent]])}
    for share in (0.2, 0.7):
        down, up = (
            float(
                force(setting, values, middle(setting, displacement=share * setting.stroke, sign=sign))[0, 0]
            )
            for sign in (-1.0, 1.0)
        )
        free = 0.5 * (up + down)
        width = 1e-3 * setting.force_scale * (free / setting.force_scale) ** exponent
        assert 0.5 * (up - down) == pytest.approx(width, rel=0.01)
    assert effect("coulomb_friction:power").uses_force and not effect("coulomb_friction").uses_force


@pytest.mark.parametrize("s", [-1.0, 0.0, 1.0])
def test_a_capstan_multiplies_the_force_by_an_exponential(s: float) -> None:
    """Whichever way the strands slip; at rest there is no friction."""
    angle = 0.3
    setting = setting_for("coulomb_friction:capstan")
    values = {"K_f": np.array([[np.sinh(angle)]]), "f_s": np.zeros((1, 1))}
    at = replace(rows(setting), sign=np.full(60, s))
    bare = force(without(setting), {"f_s": np.zeros((1, 1))}, at)
    np.testing.assert_allclose(force(setting, values, at), np.exp(angle * s) * bare, rtol=1e-12)
    found = chain_of(setting).terms(values, at, bare[0])
    np.testing.assert_allclose(found.fixed, np.exp(angle * s) * bare, rtol=1e-12)
