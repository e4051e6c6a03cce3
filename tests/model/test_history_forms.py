"""Forms that go by what was before, against the process that they stand for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from mpam_calib.model.effect import effect
from mpam_calib.model.readings import FAR, Readings
from mpam_calib.model.state import Setting
from mpam_calib.physics.kinematics import SHAPES

from .forms import SPEED, STEPS, driven, one, setting_for, start

TURN = 50
"""Steps of an integration on either side of a turn."""


def small_steps(readings: Readings, setting: Setting) -> list[np.ndarray]:
    """The way (m) from one reading of :func:`driven` to the next, in many steps: TURN to the turn between."""
    step = setting.stroke / STEPS
    way = np.where(readings.travel < step, 0.5 * step, step)
    turning = np.where(readings.travel < step, 0.5 * step, 0.0)
    turning[0] = 0.0
    before = np.concatenate([[1.0], -readings.sign[:-1]])
    return [
        np.concatenate([np.full(TURN, b * t / TURN), np.full(TURN, -s * w / TURN)])
        for b, t, s, w in zip(before, turning, readings.sign, way, strict=True)
    ]


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2])
def test_a_lagging_supply_is_a_first_order_lag(share: float) -> None:
    """Of the stroke, with so much of a stroke's time as its constant; what earlier strokes left is gone."""
    setting = setting_for("pressure_droop:lagging")
    readings, lag = driven(setting), share * setting.stroke / SPEED
    step = setting.stroke / STEPS / SPEED
    decay = np.exp(-step / lag)
    # Half a step before the first reading the muscle was at rest at no contraction.
    lagged = signal.lfilter([1.0 - decay], [1.0, -decay], readings.displacement)
    values = {"droop_percent": one(0.08), "supply_lag_s": one(lag)}
    state = effect("pressure_droop:lagging").apply(start(setting, readings), values, setting)
    found = (1.0 - state.pressure / readings.pressure)[0] / 0.08
    left = np.exp(-1.0 / share)
    assert found == pytest.approx(lagged / setting.stroke, abs=2.0 / STEPS + 2.0 * left)


def test_a_supply_that_fills_a_volume_droops_in_proportion_to_it() -> None:
    """Nothing at rest, all at full stroke, and the share of πR²L between."""
    setting = setting_for("pressure_droop:volume")
    readings = driven(setting)
    values = {"droop_percent": one(0.08), "supply_lag_s": one(1e-9)}
    before = start(setting, readings)
    part = (
        1.0 - effect("pressure_droop:volume").apply(before, values, setting).pressure / readings.pressure
    ) / 0.08
    length = np.ravel(before.rest.L0) - np.linspace(0.0, setting.stroke, 200)
    shape = SHAPES[before.kinematics](length, before.rest)
    volume = np.pi * np.ravel(shape.R) ** 2 * length
    share = (volume - volume[0]) / (volume[-1] - volume[0])
    place = readings.displacement / setting.stroke
    assert part[0] == pytest.approx(np.interp(place, np.linspace(0.0, 1.0, 200), share), abs=1e-4)
    assert np.max(part[0] - place) > 0.02  # and not the stroke's


@pytest.mark.parametrize("lasts", [0.1, 1.0, 10.0, 1e4])
def test_a_supply_that_refills_keeps_the_gas_s_balance(lasts: float) -> None:
    """q = ∫ (dx − q dt/τ), never below 0; where it lasts without end, that is the droop by volume."""
    setting = setting_for("pressure_droop:refill")
    readings, way = driven(setting), lasts * setting.stroke
    q, missing = 0.0, []
    for step in small_steps(readings, setting):
        for dx in step:
            q = max(q * np.exp(-abs(dx) / way) + dx, 0.0)
        missing.append(q)

    def droop(form: str, **seconds: float) -> np.ndarray:
        values = {name: one(value) for name, value in ({"droop_percent": 0.1} | seconds).items()}
        state = effect(f"pressure_droop:{form}").apply(start(setting, readings), values, setting)
        return 1.0 - state.pressure[0] / readings.pressure

    expected = np.array(missing) / readings.displacement * droop("volume", supply_lag_s=1e-9)
    np.testing.assert_allclose(droop("refill", refill_s=way / SPEED), expected, atol=5e-4 * 0.1)


def test_a_supply_without_a_lag_is_the_plain_droop() -> None:
    setting = setting_for("pressure_droop:lagging")
    readings = driven(setting)
    values = {"droop_percent": one(0.08), "supply_lag_s": one(1e-9)}
    plain, lagging = (
        effect(form).apply(start(setting, readings), values, setting).pressure
        for form in ("pressure_droop", "pressure_droop:lagging")
    )
    np.testing.assert_allclose(lagging, plain, rtol=1e-9)


@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.0])
def test_friction_from_rest_builds_up_as_sliders_do(exponent: float) -> None:
    """Springs with sliders, their ways spread as Dahl's law has it, driven step by step."""
    setting = setting_for("presliding:masing-dahl")
    readings = driven(setting, strokes=3)
    reversal = 0.1 * setting.stroke
    values = {"reversal_mm": one(reversal), "dahl_exponent": one(exponent)}
    sign = effect("presliding:masing-dahl").apply(start(setting, readings), values, setting).sign[0]
    # After a turn 1 − s/2 is the friction not yet turned over: −g′(way)·way of it slides at that way.
    ways = np.linspace(1e-5, 1.0, 4000) * setting.stroke
    turn = ways / reversal
    beyond = exponent - 1.0
    left = np.exp(-turn) if beyond == 0.0 else np.maximum(1.0 + beyond * turn, 0.0) ** (-1.0 / beyond)
    weights = np.gradient(np.gradient(left, ways), ways) * ways
    weights /= weights.sum()
    load, friction, before = np.zeros(len(ways)), [], 0.0
    for x in readings.displacement:
        load = np.clip(load + 2.0 * (x - before) / ways, -1.0, 1.0)
        friction.append(-float(weights @ load))
        before = x
    assert sign == pytest.approx(np.array(friction), abs=0.03)


def uneven(setting: Setting, lengths: list[float]) -> Readings:
    """Strokes of such lengths, in the stroke's own, back and forth from no contraction."""
    strokes = [driven(setting, strokes=1) for _ in lengths]
    ways = np.array(lengths) * setting.stroke
    turns = np.concatenate([[0.0], np.cumsum(ways * (-1.0) ** np.arange(len(ways)))])
    before = np.concatenate([[FAR, FAR], ways])
    for i, (stroke, length) in enumerate(zip(strokes, lengths, strict=True)):
        way, direction = length * stroke.travel, (-1.0) ** i
        strokes[i] = replace(
            stroke,
            displacement=turns[i] + direction * way,
            sign=np.full(STEPS, -direction),
            travel=way,
            reversal=np.full(STEPS, float(i > 0)),
            cycle=np.full(STEPS, i // 2 + 1.0),
            strokes_before=np.tile(before[[i + 1, i]], (STEPS, 1)),
        )
    return Readings.join(strokes)


def friction_by_dahl(setting: Setting, form: str, readings: Readings, reversal: float) -> np.ndarray:
    values = {"reversal_mm": one(reversal)}
    return effect(form).apply(start(setting, readings), values, setting).sign[0]


@pytest.mark.parametrize(("form", "begins"), [("presliding:rest", 0.0), ("presliding", 1.0)])
@pytest.mark.parametrize("reversal", [0.05, 0.1])
def test_small_reversals_hand_on_what_friction_they_reached(
    form: str, begins: float, reversal: float
) -> None:
    """Dahl's equation ds/dx = (±1 − s)/reversal along strokes too short for full friction."""
    setting = setting_for("presliding:rest")
    lengths = [1.0, 0.2, 0.15, 0.95, 0.3]
    readings = uneven(setting, lengths)
    s, expected = begins, []
    for i, length in enumerate(lengths):
        way, direction = (np.arange(STEPS) + 0.5) / STEPS * length, -((-1.0) ** i)
        expected.append(direction + (s - direction) * np.exp(-way / reversal))
        s = direction + (s - direction) * np.exp(-length / reversal)
    found = friction_by_dahl(setting, form, readings, reversal * setting.stroke)
    np.testing.assert_allclose(found, np.concatenate(expected), atol=0.01)


def test_friction_of_short_strokes_alike_never_turns_over_wholly() -> None:
    setting = setting_for("presliding:rest")
    readings = uneven(setting, [0.2] * 5)
    found = friction_by_dahl(setting, "presliding:rest", readings, 0.2 * setting.stroke)
    left = np.exp(-1.0)
    steady = (1.0 - left) / (1.0 + left)
    last = found[-STEPS:]
    assert last[[0, -1]] == pytest.approx(np.array([-steady, steady]) * readings.sign[-1], abs=0.02)


@pytest.mark.parametrize("form", ["wen", "rest-wen", "once-wen"])
@pytest.mark.parametrize("exponent", [1.0, 2.0])
def test_friction_by_bouc_and_wen_follows_their_equation(form: str, exponent: float) -> None:
    """dz/dx = 1 − |z|^n (1 + sgn(z ẋ))/2, through two levels that begin in one way or another."""
    setting = setting_for("presliding:wen")
    level = driven(setting, strokes=2)
    readings = Readings.join([replace(level, test_cycle=np.full(2 * STEPS, i)) for i in (1.0, 2.0)])
    reversal = 0.1 * setting.stroke
    values = {"reversal_mm": one(reversal), "wen_exponent": one(exponent)}
    found = effect(f"presliding:{form}").apply(start(setting, readings), values, setting).sign[0]
    begins = {"wen": (1.0, 1.0), "rest-wen": (0.0, 0.0), "once-wen": (0.0, None)}[form]
    z, expected = 0.0, []
    for i, step in enumerate(small_steps(readings, setting)):
        begun = begins[i // (2 * STEPS)] if i % (2 * STEPS) == 0 else None
        if begun is not None:
            z, step = begun, step[TURN:]
        for dx in -step / reversal:
            z += dx * (1.0 - abs(z) ** exponent * (z * dx > 0.0))
        expected.append(z)
    np.testing.assert_allclose(found, expected, atol=1e-3)


def test_rubber_is_as_new_on_its_first_stroke_and_at_the_end_of_every_other() -> None:
    setting = setting_for("stress_softening:virgin-fading")
    readings = replace(driven(setting), level=np.zeros(4 * STEPS, dtype=np.int64))
    setting = replace(setting, strokes=None)
    values = {
        "first_cycle_fraction": one(0.3), "softening_reach": one(0.2), "cycle_exponent": one(1.0),
    }  # fmt: skip
    gain = effect("stress_softening:virgin-fading").apply(start(setting, readings), values, setting).wall_gain
    excess = np.broadcast_to(gain, (1, 4 * STEPS))[0] - 1.0
    np.testing.assert_allclose(excess[:STEPS], 0.3)
    assert excess[STEPS] == pytest.approx(0.3, rel=0.02)  # at the turn the way is none
    assert excess[3 * STEPS] == pytest.approx(0.15, rel=0.02)  # in the second cycle half is left
    np.testing.assert_allclose(excess[2 * STEPS - 1 : 2 * STEPS + 1], 0.0, atol=1e-9)  # at no contraction


def test_over_a_test_only_what_was_never_stretched_is_as_new() -> None:
    """A stroke of half the length before the whole one: its first half has softened."""
    setting = setting_for("stress_softening:test-virgin")
    whole = driven(setting, strokes=1)
    half = replace(whole, displacement=0.5 * whole.displacement)
    x = np.concatenate([half.displacement, whole.displacement])
    readings = replace(
        Readings.join([half, whole]), behind=np.maximum.accumulate(x) - x, cycle=np.ones(len(x))
    )
    values = {"first_cycle_fraction": one(0.3), "softening_reach": one(0.05)}
    gain = effect("stress_softening:test-virgin").apply(start(setting, readings), values, setting).wall_gain
    excess = np.broadcast_to(gain, (1, len(x)))[0] - 1.0
    np.testing.assert_allclose(excess[:STEPS], 0.3)
    again = excess[STEPS:]
    np.testing.assert_allclose(again[whole.displacement < 0.3 * setting.stroke], 0.0, atol=1e-6)
    np.testing.assert_allclose(again[whole.displacement > 0.5 * setting.stroke], 0.3)


@pytest.mark.parametrize("delay", [0.3, 1.1])
def test_a_late_cell_is_read_at_the_place_of_a_moment_before(delay: float) -> None:
    """On a path that begins at rest: before that it stood still."""
    setting = setting_for("presliding")
    readings = driven(setting)
    delay *= setting.stroke / STEPS / SPEED * 20.0
    time = np.cumsum(np.abs(np.diff(readings.displacement, prepend=0.0))) / SPEED
    before = start(setting, readings)
    after = effect("late_force").apply(before, {"cell_delay_s": one(delay)}, setting)
    expected = np.interp(time - delay, np.append(0.0, time), np.append(0.0, readings.displacement))
    # Between the readings on both sides of a turn the way there is longer than their distance.
    np.testing.assert_allclose(after.displacement[0], expected, atol=2.0 * setting.stroke / STEPS)
    past = np.interp(time - delay, time, np.arange(len(time)))
    sure = np.abs(readings.travel / (delay * SPEED) - 1.0) > 0.25
    assert np.mean(sure) > 0.9
    np.testing.assert_array_equal(after.sign[0][sure], readings.sign[np.round(past).astype(int)][sure])


@pytest.mark.parametrize("share", [0.2, 0.5, 1.0])
def test_a_late_cell_next_to_a_turn_is_read_no_farther_than_the_stroke_s_pace_takes_it(share: float) -> None:
    """However rough the speed there: travel of half a micrometre, at a share of the pace."""
    setting = setting_for("presliding")
    readings = driven(setting)
    readings = replace(readings, travel=np.full(len(readings), 5e-7), speed=share * readings.pace)
    before = start(setting, readings)
    after = effect("late_force").apply(before, {"cell_delay_s": one(0.3)}, setting)
    moved = np.abs(after.displacement - before.displacement)
    assert np.all(moved <= 0.5 * np.pi * SPEED * 0.3 * (1.0 + 1e-9))
    assert np.all(np.isfinite(after.sign))


@pytest.mark.parametrize(("low", "high"), [(0.03, 0.0), (0.01, 0.02), (0.0, 0.03)])
def test_a_gauge_with_play_is_off_by_it_between_there_and_back(low: float, high: float) -> None:
    """A pointer that is dragged along: where it moves, the muscle is where the effect says."""
    setting = setting_for("strand_friction")
    readings = driven(setting)
    true, shown, at = readings.displacement, np.empty(len(readings)), 0.0
    for i, x in enumerate(true):
        at = min(max(at, x - low * setting.stroke), x + high * setting.stroke)
        shown[i] = at
    values = {"play_mm": one((low + high) * setting.stroke), "play_share": one(low / (low + high))}
    before = start(setting, replace(readings, displacement=shown))
    after = effect("gauge_play").apply(before, values, setting)
    moves = np.abs(np.diff(shown, prepend=0.0)) > 1e-12
    assert 0.9 < np.mean(moves) < 1.0
    np.testing.assert_allclose(after.displacement[0][moves], true[moves], atol=1e-12)
