"""Bent effects: the same cause at bend zero, a size that follows its driver otherwise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.model.bend import BENDS, DRIVERS, MOST, bend_factor
from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import Values, bent, effect, known_effects
from mpam_calib.model.readings import FAR, TIMES, Readings
from mpam_calib.model.state import Setting, State
from mpam_calib.specimen.effect_ids import forms_of_id

from . import build

OF_THE_BLADDER = ("stress_softening", "law_shape")
BENT = sorted(e for e in known_effects() if effect(e).bends)


def setting_for(form: str) -> Setting:
    kinematics = "constant_thickness" if form.startswith("braid_kinematics") else "inextensible_braid"
    friction = "strand" if form.startswith("coulomb") else "coulomb"
    declared = {"law": "constant", "order": 2, "effects": (form,), "kinematics": kinematics}
    setting = build.blueprint(declared | {"friction": friction}).setting()
    assert setting is not None
    return replace(setting, duration=100.0, level_time=40.0, speed=1e-3)


def rows(setting: Setting, count: int = 40) -> Readings:
    """Rows of one level whose time, cycle, travel and speed all vary."""
    share = np.linspace(0.02, 0.98, count)
    return Readings(
        pressure=np.linspace(float(setting.levels[0]), setting.top_pressure, count),
        displacement=share * setting.stroke,
        sign=np.where(np.arange(count) % 2, 1.0, -1.0),
        level=np.zeros(count, dtype=np.int64),
        time=100.0 * share,
        file_time=100.0 * share,
        time_at_level=40.0 * share,
        cycle=1.0 + np.arange(count) % 3,
        test_cycle=1.0 + np.arange(count) % 3,
        travel=share * setting.stroke,
        reversal=np.ones(count),
        strokes_before=np.full((count, 2), FAR),
        speed=1e-3 * 10.0 ** (2.0 * share - 1.0),
        behind=np.zeros(count),
        relaxed=-np.expm1(-40.0 * share[:, None] / TIMES),
        pace=np.full(count, 2e-3),
    )


def values_of(setting: Setting, form: str, u: float, bends: float) -> Values:
    declared = {"K_f": np.array([[0.05]]), "f_s": np.array([[0.1]])}
    own = {
        p.name: p.prior.from_normal(np.full((1, 1), bends if BENDS in p.name else u))
        for p in effect(form).parameters(setting)
    }
    return declared | own


def force_of(form: str, u: float, bends: float) -> np.ndarray:
    setting = setting_for(form)
    force = Chain(setting, None, False).force(
        values_of(setting, form, u, bends), np.zeros((1, 0)), rows(setting)
    )
    return np.broadcast_to(force, (1, 40))[0]


@pytest.mark.parametrize("identifier", BENT)
def test_a_straight_bend_is_the_plain_effect(identifier: str) -> None:
    plain, bent = force_of(identifier, 0.7, 0.0), force_of(f"{identifier}:bent", 0.7, 0.0)
    assert bent == pytest.approx(plain, rel=1e-12, abs=1e-9)
    if identifier in OF_THE_BLADDER:
        return  # and there is none here
    moved = force_of(f"{identifier}:bent", 0.7, 1.0)
    assert np.max(np.abs(moved - plain)) > 1e-3 * np.max(np.abs(plain - force_of(identifier, -7.0, 0.0)))


def test_the_size_follows_the_driver() -> None:
    """An offset that grows along the stroke and settles in time: every row has its own."""
    form = "length_offset:bent"
    setting = setting_for(form)
    readings = rows(setting)
    values = dict(values_of(setting, form, 0.0, 0.0))
    values |= {
        "offset_mm": np.array([[1e-3]]),
        "offset_mm_bend_1": np.array([[0.4]]),
        "offset_mm_bend_2": np.array([[-0.3]]),
    }
    bent = Chain(setting, None, False).force(values, np.zeros((1, 0)), readings)[0]
    along = 2.0 * readings.displacement / setting.stroke - 1.0
    in_time = 2.0 * np.log(1.0 + 20.0 * readings.time / setting.duration) / np.log(21.0) - 1.0
    local = 1e-3 * (1.0 + 0.4 * along) * np.exp(-0.3 * in_time)
    plain = replace(setting, simulation=setting.simulation.model_copy(update={"effects": ()}))
    shifted = replace(readings, displacement=readings.displacement + local)
    expected = Chain(plain, None, False).force(values, np.zeros((1, 0)), shifted)[0]
    assert bent == pytest.approx(expected, rel=1e-12)


def test_an_effect_of_several_sizes_bends_as_a_whole() -> None:
    """A law's bends, one for each power of pressure, all change along the stroke by the same factor."""
    setting = setting_for("law_shape:bent")
    readings = rows(setting)
    names = [p.name for p in effect("law_shape").parameters(setting)]
    assert len(names) > 1
    values = {name: np.array([[0.1 * (i + 1)]]) for i, name in enumerate(names)}
    values |= {"law_bend_1_bend_1": np.array([[0.4]]), "law_bend_1_bend_2": np.array([[0.0]])}
    item = effect("law_shape:bent")
    gain = item.apply(Chain(setting, None, False).start(readings, np.zeros(1)), values, setting).wall_gain
    pressure = 2.0 * readings.pressure - setting.levels[0] - setting.top_pressure
    x = pressure / (setting.top_pressure - setting.levels[0])
    law = np.polynomial.legendre.legval(x, [0.0, *(values[name][0, 0] for name in names)])
    along = 2.0 * readings.displacement / setting.stroke - 1.0
    np.testing.assert_allclose(gain[0], 1.0 + law * (1.0 + 0.4 * along), rtol=1e-12)


@pytest.mark.parametrize("bends", [-50.0, 50.0])
def test_what_fades_never_turns_round(bends: float) -> None:
    """However far the coefficients go, the local size keeps its sign and stays within e^±MOST of its own."""
    form = "creep:bent"
    setting = setting_for(form)
    given = dict(values_of(setting, form, 0.0, bends)) | {"creep_per_decade": np.array([[0.01]])}
    seen: list[np.ndarray] = []

    def watch(state: State, values: Values, where: Setting) -> State:
        seen.append(np.asarray(values["creep_per_decade"]))
        return state

    item = replace(effect("creep"), apply=watch)
    bent(item).apply(Chain(setting, None, False).start(rows(setting), np.zeros(1)), given, setting)
    local = seen[0] / 0.01
    assert local.min() >= np.exp(-MOST) - 1e-12 and local.max() <= np.exp(MOST) + 1e-12
    assert local.min() < 1.0 < local.max()


def test_a_bend_along_the_stroke_turns_its_first_power_into_the_second() -> None:
    """A droop in proportion to the stroke, times 1 + P₁, is one with the stroke's square: exactly."""
    form = "pressure_droop:bent"
    setting = setting_for(form)
    names = {p.name: np.zeros((1, 1)) for p in effect(form).parameters(setting)}
    given = names | {"droop_percent": np.array([[0.04]]), "droop_percent_bend_1": np.array([[1.0]])}
    readings = rows(setting)
    drooped = effect(form).apply(Chain(setting, None, False).start(readings, np.zeros(1)), given, setting)
    share = readings.displacement / setting.stroke
    np.testing.assert_allclose(drooped.pressure[0], readings.pressure * (1.0 - 0.08 * share**2), rtol=1e-12)


def test_friction_in_proportion_to_speed_does_not_know_the_force() -> None:
    """``rate_friction:viscous``: beside Coulomb friction K at the force scale, rate·K·(v/v₀)/ln 10 of it."""
    form = "rate_friction:viscous"
    setting = setting_for(form)
    readings = rows(setting)
    start = Chain(setting, None, False).start(readings, np.zeros(1))._replace(coulomb=np.array([[0.05]]))
    moved = effect(form).apply(start, {"rate_per_decade": np.array([[0.4]])}, setting)
    per_decade = 0.4 * 0.05 * setting.force_scale
    expected = per_decade * readings.speed / setting.speed / np.log(10.0)
    np.testing.assert_allclose(moved.drag[0], expected, rtol=1e-12)
    assert moved.friction_gain is start.friction_gain


@pytest.mark.parametrize("beside", [(), ("rate_friction:viscous",)])
@pytest.mark.parametrize("friction", ["coulomb", "strand"])
@pytest.mark.parametrize("form", ["creep", "stress_softening:force"])
def test_history_acts_on_the_whole_force(form: str, friction: str, beside: tuple[str, ...]) -> None:
    """The chain's fifth stage comes after friction: every kind of it relaxes and softens like the rest."""

    def setting_of(effects: tuple[str, ...]) -> Setting:
        declared = {"law": "constant", "order": 2, "effects": effects, "friction": friction}
        setting = build.blueprint(declared).setting()
        assert setting is not None
        return replace(setting, duration=100.0, level_time=40.0, speed=1e-3)

    plain, aged = setting_of(beside), setting_of((*beside, form))
    readings, eta = rows(plain), np.zeros((1, 0))
    values = {**values_of(aged, form, 1.0, 0.0), "rate_per_decade": np.array([[0.4]])}
    force = Chain(plain, None, False).force(values, eta, readings)
    smooth = Chain(plain, None, False).force(
        values | dict.fromkeys(("K_f", "f_s"), np.zeros((1, 1))), eta, readings
    )
    assert np.max(np.abs(force - smooth)) > 0.1
    gain = effect(form).apply(Chain(aged, None, False).start(readings, np.zeros(1)), values, aged).gain
    assert np.ptp(gain) > 0.01
    np.testing.assert_allclose(
        Chain(aged, None, False).force(values, eta, readings), gain * force, rtol=1e-12
    )


def test_a_drift_that_settles_ends_where_the_straight_one_does() -> None:
    setting = setting_for("force_drift:settling")
    readings = rows(setting)
    start = Chain(setting, None, False).start(readings, np.zeros(1))
    given = {"drift_N_per_min": np.array([[0.3]])}
    late, straight = (
        effect(f).apply(start, given, setting).zero[0] for f in ("force_drift:settling", "force_drift")
    )
    np.testing.assert_allclose(
        np.interp(50.0, readings.time, late / straight), np.log(11.0) / np.log(21.0) * 2.0, rtol=1e-3
    )
    assert np.all(late > straight)


@pytest.mark.parametrize(("period", "phase"), [(40.0, 0.5), (250.0, -1.2)])
def test_a_zero_that_swings_is_a_sine_of_time(period: float, phase: float) -> None:
    """z″ = −(2π/T)² z, of the size that the line has at half the test; where it stands at first is free."""
    setting = setting_for("force_drift:swing")
    readings = replace(rows(setting), time=np.linspace(0.0, setting.duration, 40))
    given = {
        "drift_N_per_min": np.array([[0.3]]),
        "swing_s": np.array([[period]]),
        "swing_phase_deg": np.array([[phase]]),
    }
    start = Chain(setting, None, False).start(readings, np.zeros(1))
    (zero,) = effect("force_drift:swing").apply(start, given, setting).zero
    step = readings.time[1]
    between = 2.0 * np.cos(2.0 * np.pi * step / period) * zero[1:-1]
    np.testing.assert_allclose(zero[2:] + zero[:-2], between, atol=1e-10)
    size = 0.3 * 0.5 * setting.duration
    assert zero[0] == pytest.approx(size * np.sin(phase))
    assert (zero[1] - zero[0]) / step == pytest.approx(
        2.0 * np.pi / period * size * np.cos(phase + np.pi * step / period), rel=0.01
    )


def test_a_drift_that_comes_back_passes_its_zero() -> None:
    """Added bends: with no size at all the slope is sd·Σ c_j P_j; at the test's end, where P_j = 1, too."""
    form = "force_drift:tared-bent"
    setting = setting_for(form)
    readings = replace(rows(setting), file_time=7.0 * np.ones(40))
    given = {p.name: np.zeros((1, 1)) for p in effect(form).parameters(setting)}
    given |= {"drift_N_per_min_bend_1": np.array([[0.4]]), "drift_N_per_min_bend_2": np.array([[-0.3]])}
    zero = effect(form).apply(Chain(setting, None, False).start(readings, np.zeros(1)), given, setting).zero
    v = np.clip(2.0 * readings.time / max(setting.duration, 1.0) - 1.0, -1.5, 1.5)
    slope = np.polynomial.legendre.legval(v, [0.0, 0.4, -0.3])
    unit = effect("force_drift").parameters(setting)[0].prior.sd
    np.testing.assert_allclose(zero[0], 7.0 * unit * slope, rtol=1e-12)


def test_what_softened_at_one_level_stays_soft_at_the_next() -> None:
    setting = setting_for("stress_softening:test-force")
    readings = replace(rows(setting), test_cycle=np.arange(40.0) + 1.0)
    start = Chain(setting, None, False).start(readings, np.zeros(1))
    given = {"first_cycle_fraction": np.array([[0.2]])}
    expected = 1.0 + 0.2 * np.exp(-np.arange(40.0))
    for form, name in (("test-force", "gain"), ("test", "wall_gain")):
        gain = getattr(effect(f"stress_softening:{form}").apply(start, given, setting), name)
        np.testing.assert_allclose(gain[0], expected, rtol=1e-12)


def test_full_stroke_may_be_each_levels_own() -> None:
    """Between levels their strokes are interpolated; a level without any has the longest."""
    setting = setting_for("pressure_droop:level")
    strokes = setting.stroke * np.linspace(0.4, 1.0, len(setting.levels))
    strokes[0] = 0.0
    setting = replace(setting, strokes=strokes)
    readings = rows(setting)
    start = Chain(setting, None, False).start(readings, np.zeros(1))
    given = {"droop_percent": np.array([[0.03]])}
    pressure = effect("pressure_droop:level").apply(start, given, setting).pressure[0]
    strokes[0] = setting.stroke
    own = np.interp(readings.pressure, setting.levels, strokes)
    np.testing.assert_allclose(pressure, readings.pressure * (1.0 - 0.03 * readings.displacement / own))


def test_the_list_of_forms_is_that_of_the_effects() -> None:
    """Specimen files are checked against a list that does not import the effects: it must be theirs."""
    for identifier in known_effects():
        assert set(forms_of_id(identifier)) == set(effect(identifier).all_forms), identifier
    assert all(set(effect(identifier).bends) <= set(DRIVERS) for identifier in known_effects())


def test_kinds_bend_too() -> None:
    assert effect("stress_softening:force-bent").id == "stress_softening:force-bent"
    assert force_of("stress_softening:force-bent", 0.5, 0.0) == pytest.approx(
        force_of("stress_softening:force", 0.5, 0.0), rel=1e-12
    )
    with pytest.raises(KeyError):
        effect("creep:nonsense")


def test_creep_of_the_bladder_is_a_gain_on_its_stress() -> None:
    setting = setting_for("creep:wall")
    readings = rows(setting)
    state = Chain(setting, None, False).start(readings, np.zeros(1))
    given = {"creep_per_decade": np.array([[0.05]])}
    relaxed = effect("creep:wall").apply(state, given, setting)
    expected = 1.0 - 0.05 * np.log10(1.0 + readings.time_at_level)
    np.testing.assert_allclose(relaxed.wall_gain[0], expected, rtol=1e-12)
    assert relaxed.gain is state.gain


def test_bases_that_are_kept_belong_to_their_readings_and_their_setting() -> None:
    """And vectors of which some bend are as each by itself."""
    setting = setting_for("creep:bent")
    longer, readings = replace(setting, stroke=2.0 * setting.stroke), rows(setting)
    later = replace(readings, displacement=0.5 * readings.displacement)
    c = np.array([[0.0], [0.3], [0.0], [-0.2]])
    values, bends = {f"size{BENDS}1": c}, {"contraction": 1}
    for found, where, share in ((setting, readings, 1.0), (longer, readings, 0.5), (longer, later, 0.25)):
        state = Chain(found, None, False).start(where, np.zeros(1))
        expected = 1.0 + c * (2.0 * share * readings.displacement / setting.stroke - 1.0)
        for _ in range(2):
            np.testing.assert_allclose(bend_factor("size", bends, values, state, found), expected)
