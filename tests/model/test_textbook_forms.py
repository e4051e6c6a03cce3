"""Forms by textbooks' equations, each written out by itself, and where those of one effect agree."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpam_calib.model.effect import effect
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHAPES, radius_inextensible_braid
from mpam_calib.physics.statics import axial_lever, hoop_lever, strains

from .test_forms_by_their_law import rubbing
from .test_history_forms import one
from .test_literature_forms import DURATION, LEVELS, SPEED, middle, rows, setting_for, start

Array = np.ndarray
MIDDLE = 500.0 * (LEVELS[0] + LEVELS[-1])
"""Pa: the middle of the levels, where forms that go by the pressure agree with the effect's own."""
ARC = np.pi - 2.0
"""Length that Eq. 2.47 takes for each metre by which the radius grows."""


def shaped(setting: Setting, at: Any = None) -> State:
    """A state with its length and shape, without a fixture or tips."""
    state = start(setting, rows(setting) if at is None else at)
    length = state.rest.L0 - state.displacement
    return state._replace(length=length, shape=SHAPES[state.kinematics](length, state.rest))


def applied(form: str, state: State, setting: Setting, **values: float) -> State:
    return effect(form).apply(state, {name: one(value) for name, value in values.items()}, setting)


def proportional(found: Array, expected: Array) -> None:
    found, expected = np.broadcast_arrays(np.ravel(found), np.ravel(expected))
    i = int(np.argmax(np.abs(expected)))
    np.testing.assert_allclose(found / found[i], expected / expected[i], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize(
    ("form", "own", "path"),
    [
        ("", {}, lambda t: t),
        (":settling", {}, lambda t: DURATION * np.log(1.0 + 20.0 * t / DURATION) / np.log(21.0)),
        (":early", {"tared_before_s": 40.0}, lambda t: t + 40.0),
        (":power", {"drift_exponent": 2.0}, lambda t: t**2 / 150.0),
        (":root", {}, lambda t: np.sqrt(150.0 * t)),
        (":return", {}, lambda t: 150.0 * np.sin(np.pi * t / DURATION)),
        (":swing", {"swing_s": 90.0, "swing_phase_deg": 0.4}, lambda t: 150.0 * np.sin(np.pi * t / 45 + 0.4)),
        (":thermal", {"warming_s": 70.0}, lambda t: 150.0 * (1 - np.exp(-t / 70)) / (1 - np.exp(-150 / 70))),
    ],
)  # fmt: skip
def test_a_zero_drifts_along_its_path(form: str, own: dict[str, float], path: Any) -> None:
    """Seconds of the plain line; but for the start and a swing all agree at half the test, or at its end."""
    setting = setting_for("force_drift")
    state = shaped(setting)
    after = applied(f"force_drift{form}", state, setting, drift_N_per_min=0.002, **own)
    np.testing.assert_allclose(np.ravel(after.zero), 0.002 * path(state.readings.time), atol=1e-12)


def test_a_cell_that_is_tared_drifts_anew_in_each_file() -> None:
    setting = setting_for("force_drift:tared")
    at = replace(rows(setting), file_time=np.arange(60.0) % 20.0)
    after = applied("force_drift:tared", shaped(setting, at), setting, drift_N_per_min=0.002)
    np.testing.assert_allclose(np.ravel(after.zero), 0.002 * at.file_time)


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


@pytest.mark.parametrize(
    ("form", "own", "lost"),
    [
        ("soft", {}, lambda P: 5e3 * (1.0 - np.exp(-P / 5e3))),
        ("power", {"dead_band_exponent": -0.7}, lambda P: 5e3 * (P / MIDDLE) ** -0.7),
        ("closing", {"closing_kPa": 9e4}, lambda P: 5e3 * np.exp((MIDDLE - P) / 9e4)),
    ],
)
def test_a_dead_band_goes_with_the_pressure(form: str, own: dict[str, float], lost: Any) -> None:
    setting = setting_for(f"dead_band:{form}")
    state = shaped(setting)
    after = applied(f"dead_band:{form}", state, setting, P_DB_kPa=5e3, **own)
    np.testing.assert_allclose(state.pressure - after.pressure, lost(state.pressure), rtol=1e-9)


def test_what_seats_itself_is_off_by_a_power_of_the_pressure() -> None:
    setting = setting_for("length_offset:seating")
    state = shaped(setting)
    part = (state.pressure / MIDDLE) ** 0.6
    moved = applied("length_offset:seating", state, setting, offset_mm=2e-3, offset_exponent=0.6).displacement
    np.testing.assert_allclose(moved - state.displacement, 2e-3 * part, rtol=1e-9)
    turned = applied("braid_angle:seating", state, setting, delta_alpha_deg=0.02, seating_exponent=0.6).rest
    np.testing.assert_allclose(np.broadcast_to(turned.alpha0 - state.rest.alpha0, part.shape), 0.02 * part)


def test_a_crosshead_zeroed_anew_is_off_by_each_level_s_share_and_else_by_the_mean() -> None:
    setting = setting_for("length_offset:rezeroed")
    at = replace(rows(setting, 5), level=np.array([0, 1, 2, 3, -1]))
    state = shaped(setting, at)
    shares = {f"offset_level_{i + 1}": share for i, share in enumerate((0.5, 2.0, 1.0, -0.5))}
    moved = applied("length_offset:rezeroed", state, setting, offset_mm=2e-3, **shares).displacement
    np.testing.assert_allclose(np.ravel(moved - state.displacement), 2e-3 * np.array([0.5, 2, 1, -0.5, 0.75]))


def test_a_fixture_gives_by_its_law_and_as_much_at_the_force_scale() -> None:
    setting = setting_for("rig_compliance:toe")
    load = np.array([[-1.0, 0.5, 1.0, 2.0, 4.0]])
    state = shaped(setting, rows(setting, 5))._replace(guide=setting.force_scale * load)

    def give(form: str, **own: float) -> Array:
        after = applied(f"rig_compliance:{form}", state, setting, compliance_mm_per_N=1e-5, **own)
        return (after.displacement - state.displacement) / (1e-5 * setting.force_scale)

    toe = give("toe", toe_N=0.7 * setting.force_scale)
    expected = np.sign(load) * (1.0 - np.exp(-np.abs(load) / 0.7)) / (1.0 - np.exp(-1.0 / 0.7))
    np.testing.assert_allclose(toe, expected, rtol=1e-9)
    # A power is rounded off at no force alone.
    hertz = give("power", compliance_exponent=2.0 / 3.0)
    np.testing.assert_allclose(hertz, np.sign(load) * np.abs(load) ** (2.0 / 3.0), rtol=5e-3)
    assert hertz[0, 2] == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("form", "own", "harder"),
    [
        ("fung", {"hardening": 0.8}, lambda e: np.exp(0.8 * e)),
        ("gent", {"limit_strain": 1.5}, lambda e: 1.0 / (1.0 - (e / 1.5) ** 2)),
    ],
)
def test_a_missing_term_hardens_in_both_directions(form: str, own: dict[str, float], harder: Any) -> None:
    setting = setting_for(f"order_too_low:{form}")
    state = shaped(setting)
    assert state.shape is not None
    after = applied(f"order_too_low:{form}", state, setting, next_order=0.1, **own)
    z, x = strains(state.shape, state.rest, "engineering")
    stress = axial_lever(state.shape) * z**3 * harder(z) - hoop_lever(state.shape) * x**3 * harder(x)
    proportional(state.lost - after.lost, stress)
    assert np.sign(state.lost - after.lost)[0, -1] == np.sign(stress)[0, -1]


def test_a_wall_s_share_goes_with_its_thickness_over_its_radius() -> None:
    setting = setting_for("wall_pressure:thick")
    state, half = shaped(setting), shaped(setting, middle(setting))
    own = {"wall_factor": 0.4, "thickness_exponent": 1.3}
    assert state.shape is not None
    share = 1.0 - applied("wall_pressure:thick", state, setting, **own).wall_factor
    proportional(share, (state.shape.t / state.shape.R) ** 1.3)
    assert 1.0 - applied("wall_pressure:thick", half, setting, **own).wall_factor == pytest.approx(0.4)


@pytest.mark.parametrize(
    ("form", "own", "shape"),
    [
        ("", {}, lambda R, R0, x: R - R0),
        (":power", {"tip_exponent": 2.0}, lambda R, R0, x: np.sign(R - R0) * (R - R0) ** 2),
        (":round", {}, lambda R, R0, x: R),
        (":tapered", {}, lambda R, R0, x: x),
    ],
)
def test_tips_take_a_length_by_their_shape(form: str, own: dict[str, float], shape: Any) -> None:
    """At half the stroke all take what Eq. 2.47 does."""
    setting = setting_for("tip_shape")
    state, half = shaped(setting), shaped(setting, middle(setting))
    own = {"tip_factor": 0.8, **own}
    R = radius_inextensible_braid(state.length, state.rest)
    lost = state.length - applied(f"tip_shape{form}", state, setting, **own).length
    proportional(lost, shape(R, state.rest.R0, state.displacement))
    there = half.length - applied(f"tip_shape{form}", half, setting, **own).length
    growth = radius_inextensible_braid(half.length, half.rest) - half.rest.R0
    np.testing.assert_allclose(there, 0.8 * ARC * growth, rtol=1e-9)


def test_tips_by_the_working_length_solve_its_equation() -> None:
    setting = setting_for("tip_shape:working")
    state = shaped(setting)
    length = applied("tip_shape:working", state, setting, tip_factor=0.8).length
    growth = radius_inextensible_braid(length, state.rest) - state.rest.R0
    np.testing.assert_allclose(length + 0.8 * ARC * growth, state.length, rtol=1e-9)


def test_what_conical_ends_lack_of_the_cylinder_does_no_work() -> None:
    """−P dV/dL of the volume outside two cones of 45° from R0 to R, by differences."""
    setting = setting_for("tip_shape:volume")
    state = shaped(setting)
    after = applied("tip_shape:volume", state, setting, tip_factor=0.8)

    def lacks(length: Array) -> Array:
        R = radius_inextensible_braid(length, state.rest)
        cone = np.pi / 3.0 * (R - state.rest.R0) * (R**2 + R * state.rest.R0 + state.rest.R0**2)
        return 2.0 * (np.pi * R**2 * (R - state.rest.R0) - cone)

    step = 1e-6 * state.rest.L0
    slope = (lacks(state.length + step) - lacks(state.length - step)) / (2.0 * step)
    np.testing.assert_allclose(after.lost, -0.8 * state.pressure * slope, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(after.length, state.length)


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
    ("form", "own", "decades"),
    [
        ("", {}, lambda t: np.log10(1.0 + t)),
        ("early", {"creep_before_s": 5.0}, lambda t: np.log10(6.0 + t)),
        ("power", {"creep_before_s": 5.0, "creep_exponent": 1.0}, lambda t: np.log10(31.0) * (t + 5) / 30),
        (
            "solid",
            {"creep_before_s": 5.0, "relaxation_s": 20.0},
            lambda t: np.log10(31.0) * (1.0 - np.exp(-(t + 5.0) / 20.0)) / (1.0 - np.exp(-1.5)),
        ),
    ],
)  # fmt: skip
@pytest.mark.parametrize("wall", [False, True])
def test_relaxation_counts_decades_of_the_time_at_a_level(
    form: str, own: dict[str, float], decades: Any, wall: bool
) -> None:
    """Of the whole force or of the bladder's stress, and the other is left alone."""
    setting = setting_for("creep")
    state = shaped(setting)
    name = ":".join(["creep", "-".join(part for part in (wall and "wall", form) if part)]).rstrip(":")
    after = applied(name, state, setting, creep_per_decade=0.04, **own)
    relaxed, other = (after.wall_gain, after.gain) if wall else (after.gain, after.wall_gain)
    expected = 1.0 - 0.04 * decades(state.readings.time_at_level)
    np.testing.assert_allclose(np.ravel(relaxed), expected, rtol=1e-9)
    np.testing.assert_array_equal(other, np.ones_like(other))


def test_a_load_cell_gives_way_beyond_its_knee_alone() -> None:
    setting = setting_for("force_drift")
    scale = setting.force_scale
    state = shaped(setting, rows(setting, 4))._replace(guide=scale * np.array([[-1.0, 0.4, 0.9, 1.4]]))
    own = {"cell_loss_N": 3.0, "cell_knee_N": 0.4 * scale, "cell_exponent": 2.0}
    after = applied("load_cell", state, setting, **own)
    np.testing.assert_allclose(after.zero, [[0.0, 0.0, -0.75, -3.0]], atol=1e-12)


def test_a_load_cell_s_zero_and_gain_are_each_level_s_and_else_the_mean() -> None:
    setting = setting_for("force_drift")
    at = replace(rows(setting, 5), level=np.array([0, 1, 2, 3, -1]))
    state, parts = shaped(setting, at), (1.0, -2.0, 3.0, 6.0)
    zeros = applied(
        "load_cell:zeroed", state, setting, **{f"cell_zero_{i + 1}_N": z for i, z in enumerate(parts)}
    )
    np.testing.assert_allclose(np.ravel(zeros.zero), [*parts, 2.0])
    gains = {f"cell_gain_{i + 1}": 0.01 * part for i, part in enumerate(parts)}
    found = applied("load_cell:rescaled", state, setting, **gains).gain
    np.testing.assert_allclose(np.ravel(found), [1.01, 0.98, 1.03, 1.06, 1.02])


@pytest.mark.parametrize(
    ("form", "own", "part"),
    [
        ("", {}, lambda x, level, v: x),
        (":power", {"droop_exponent": 1.5}, lambda x, level, v: np.sign(x) * np.abs(x) ** 1.5),
        (":level", {}, lambda x, level, v: x / level),
        (":level-power", {"droop_exponent": 2.0}, lambda x, level, v: np.sign(x) * (x / level) ** 2),
        (":speed", {"flow_exponent": 0.5}, lambda x, level, v: x * np.sqrt(v)),
    ],
)
def test_a_supply_loses_along_the_stroke(form: str, own: dict[str, float], part: Any) -> None:
    """Shares of the longest stroke, or of what the level's own is of it; speeds over the test's mean."""
    setting = setting_for("pressure_droop")
    state = shaped(setting)
    after = applied(f"pressure_droop{form}", state, setting, droop_percent=0.08, **own)
    x, v = np.ravel(state.displacement) / setting.stroke, state.readings.pace / SPEED
    level = np.interp(state.readings.pressure, setting.levels, np.linspace(0.6, 1.0, len(LEVELS)))
    lost = np.ravel(1.0 - after.pressure / state.pressure)
    np.testing.assert_allclose(lost, 0.08 * part(x, level, v), rtol=1e-9, atol=1e-15)


def test_strands_may_store_and_rub_by_another_power_of_the_pressure() -> None:
    setting = setting_for("braid_stretch:power")
    state = shaped(setting)
    plain = applied("braid_stretch", state, setting, braid_factor=1.3).lost
    lost = applied("braid_stretch:power", state, setting, braid_factor=1.3, braid_exponent=1.4).lost
    np.testing.assert_allclose(lost / plain, (state.pressure / MIDDLE) ** (1.4 - 2.0), rtol=1e-9)
    for pressure in setting.levels:
        own = rubbing("strand_friction:power", 0.5, pressure, f_s=0.3, strand_exponent=1.0)
        expected = (pressure / MIDDLE) ** (1.0 - 4.0 / 3.0) * rubbing(
            "strand_friction", 0.5, pressure, f_s=0.3
        )
        assert own == pytest.approx(expected, rel=1e-9)


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


@pytest.mark.parametrize("force", [False, True])
@pytest.mark.parametrize("test", [False, True])
@pytest.mark.parametrize("power", [False, True])
def test_softening_fades_with_a_level_s_cycles_or_the_test_s(force: bool, test: bool, power: bool) -> None:
    """Exponentially or by a power of their count, in the bladder's stress or in the whole force."""
    setting = setting_for("stress_softening")
    state = shaped(setting)
    parts = [word for word, there in (("test", test), ("force", force), ("power", power)) if there]
    own = {"cycle_exponent": 1.5} if power else {}
    form = ":".join(["stress_softening", *(["-".join(parts)] if parts else [])])
    after = applied(form, state, setting, first_cycle_fraction=0.2, **own)
    cycle = state.readings.test_cycle if test else state.readings.cycle
    gain, other = (after.gain, after.wall_gain) if force else (after.wall_gain, after.gain)
    np.testing.assert_allclose(np.ravel(gain), 1.0 + 0.2 * (cycle**-1.5 if power else np.exp(1.0 - cycle)))
    np.testing.assert_array_equal(other, np.ones_like(other))
