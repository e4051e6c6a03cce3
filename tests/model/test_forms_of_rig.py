"""Forms of the rig's effects, each against the law that it is named after or its equation written out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpam_calib.model.effect import effect
from mpam_calib.physics.kinematics import radius_inextensible_braid

from .forms import (
    LEVELS,
    MIDDLE,
    SPEED,
    applied,
    before_and_after,
    driven,
    middle,
    one,
    rows,
    setting_for,
    shaped,
    start,
)

Array = np.ndarray
ATMOSPHERE = 101325.0


@pytest.mark.parametrize("droop", [0.02, 0.1, 0.3])
def test_a_supply_that_is_shut_off_follows_boyle(droop: float) -> None:
    """One volume of the supply for all levels: (P + P_atm)·(V_supply + ΔV) stays; no braid, no droop."""
    form = "pressure_droop:reservoir"
    setting = setting_for(form)
    before, after = before_and_after(form, droop_percent=droop)
    x = np.maximum(before.displacement, 0.0)
    length = before.rest.L0 - x
    volume = np.pi * radius_inextensible_braid(length, before.rest) ** 2 * length
    grown = volume - np.pi * before.rest.R0**2 * before.rest.L0
    absolute, left = before.pressure + ATMOSPHERE, after.pressure + ATMOSPHERE
    far = grown > 0.1 * grown.max()
    supply = (left * grown / np.where(far, absolute - left, 1.0))[far]
    np.testing.assert_allclose(supply, supply[0], rtol=1e-9)
    np.testing.assert_allclose(left[grown <= 0.0], absolute[grown <= 0.0])
    # What is lost at full stroke and the middle of the levels is the droop.
    at = start(setting, middle(setting, displacement=setting.stroke))
    lost = 1.0 - effect(form).apply(at, {"droop_percent": one(droop)}, setting).pressure / at.pressure
    assert float(lost[0, 0]) == pytest.approx(droop, rel=1e-9)


@pytest.mark.parametrize("steep", [0.5, 3.0, 20.0])
def test_a_droop_that_saturates_relaxes_towards_its_end(steep: float) -> None:
    """Its slope falls with what has been lost, dy/dx = k (y_∞ − y); none at the start, all at full stroke."""
    setting = setting_for("pressure_droop:saturating")
    x = np.linspace(0.0, setting.stroke, 2001)
    at = start(setting, replace(rows(setting, len(x)), displacement=x))
    values = {"droop_percent": one(0.08), "droop_steepness": one(steep)}
    y = np.ravel(1.0 - effect("pressure_droop:saturating").apply(at, values, setting).pressure / at.pressure)
    assert y[0] == pytest.approx(0.0, abs=1e-12) and y[-1] == pytest.approx(0.08)
    left = 0.08 / -np.expm1(-steep) - y
    slope = np.gradient(y, x / setting.stroke)
    np.testing.assert_allclose(slope[1:-1], steep * left[1:-1], rtol=1e-3)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.3])
def test_a_supply_with_play_follows_as_a_loose_gear_does(share: float) -> None:
    """The place is pushed along from either side of a gap, step by step; at rest it lay in the middle."""
    setting = setting_for("pressure_droop:play")
    readings = driven(setting)
    play, place, pushed = share * setting.stroke, 0.0, []
    for x in readings.displacement:
        place = min(max(place, x - play), x + play)
        pushed.append(place)
    values = {"droop_percent": one(0.08), "supply_play_mm": one(play)}
    state = effect("pressure_droop:play").apply(start(setting, readings), values, setting)
    found = (1.0 - state.pressure[0] / readings.pressure) / 0.08
    np.testing.assert_allclose(found, np.array(pushed) / setting.stroke, atol=0.01)


@pytest.mark.parametrize("vented", [0.0, 1.0])
def test_a_throttle_loses_by_the_flow(vented: float) -> None:
    """In proportion to d(πR²L)/dt; on the way back as much the other way, or nothing where it is vented."""
    setting = setting_for("pressure_droop:throttle")
    readings = driven(setting, strokes=2)
    before = start(setting, readings)
    values = {"droop_percent": one(0.08), "vented_share": one(vented)}
    state = effect("pressure_droop:throttle").apply(before, values, setting)
    lost = 1.0 - state.pressure[0] / readings.pressure
    length = np.ravel(before.rest.L0 - before.displacement)
    volume = np.ravel(np.pi * radius_inextensible_braid(length, before.rest) ** 2 * length)
    flow = np.gradient(volume) * np.where(readings.sign < 0.0, 1.0, vented)
    inside = np.abs(readings.displacement / setting.stroke - 0.5) < 0.45
    ratio = lost[inside] / flow.max()
    np.testing.assert_allclose(
        ratio, ratio.max() * flow[inside] / flow[inside].max(), atol=5e-3 * ratio.max()
    )


@pytest.mark.parametrize("exponent", [0.0, 0.5])
def test_what_a_supply_loses_may_be_the_same_at_every_pressure(exponent: float) -> None:
    """Or go with its root; as ever in proportion to the stroke."""
    before, after = before_and_after("pressure_droop:loss", droop_percent=0.05, loss_exponent=exponent)
    lost, x = before.pressure - after.pressure, before.displacement
    rate = np.ravel(lost / x / before.pressure**exponent)
    np.testing.assert_allclose(rate, rate[0], rtol=1e-9)


def test_a_supply_may_lose_with_the_square_of_the_stroke() -> None:
    before, after = before_and_after("pressure_droop:square", droop_percent=0.1)
    lost = np.ravel(1.0 - after.pressure / before.pressure)
    place = np.ravel(before.displacement) / before.displacement.max()
    np.testing.assert_allclose(lost, 0.1 * place * np.abs(place), atol=1e-15)


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


@pytest.mark.parametrize("gap", [0.05, 0.2, 0.6])
def test_a_bladder_blown_up_to_the_braid_takes_a_thin_tube_s_pressure(gap: float) -> None:
    """Neo-Hookean, held in length: stress μ(λ² − λ⁻²) in a wall of t/λ at the radius λr."""
    before, after = before_and_after("dead_band:balloon", P_DB_kPa=5e3, bladder_gap=gap)
    length = before.rest.L0 - np.maximum(before.displacement, 0.0)
    stretch = radius_inextensible_braid(length, before.rest) / before.rest.R0 * (1.0 + gap)
    pressure = (stretch**2 - stretch**-2) / stretch / stretch
    inside = before.displacement >= 0.0
    lost = np.broadcast_to(before.pressure - after.pressure, pressure.shape)[inside]
    np.testing.assert_allclose(lost / pressure[inside], np.median(lost / pressure[inside]), rtol=1e-9)
    setting = setting_for("dead_band:balloon")
    at = start(setting, middle(setting))
    values = {"P_DB_kPa": one(5e3), "bladder_gap": one(gap)}
    there = effect("dead_band:balloon").apply(at, values, setting)
    np.testing.assert_allclose(at.pressure - there.pressure, 5e3)


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


def test_grips_bed_in_with_each_cycle() -> None:
    own = {"offset_mm": 2e-3, "offset_excess": -0.6, "bedding_cycles": 3.0}
    before, after = before_and_after("length_offset:bedding", **own)
    moved = (after.displacement - before.displacement)[0]
    loaded = before.readings.test_cycle - 1.0
    np.testing.assert_allclose(moved, 2e-3 * (1.0 - 0.6 * np.exp(-loaded / 3.0)))


@pytest.mark.parametrize("sds", [-1.0, 1.0])
def test_a_gain_error_has_the_size_of_an_instrument_s(sds: float) -> None:
    """At one prior sd about 2 % of the reading; a fifth of it is no scale but the muscle's ends."""
    for form in ("length_offset:scale", "length_offset:line"):
        setting = setting_for(form)
        at = {p.name: float(p.prior.from_normal(np.array(sds))) for p in effect(form).parameters(setting)}
        before, after = before_and_after(form, **at | {"offset_mm": abs(at["offset_mm"])})
        moved = np.ravel(after.displacement - before.displacement)
        slope, _ = np.polyfit(np.ravel(before.displacement), moved, 1)
        assert 0.015 < abs(slope) < 0.03
        fifth = {"offset_mm": 0.2 * 0.5 * setting.stroke, "scale_share": 1.0}
        away = {
            p.name: float(p.prior.to_normal(np.array(fifth[p.name])))
            for p in effect(form).parameters(setting)
        }
        assert max(map(abs, away.values())) > 4.0


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


def test_a_preloaded_fixture_is_stiff_up_to_its_preload() -> None:
    setting = setting_for("rig_compliance:preload")
    scale = setting.force_scale
    values = {"compliance_mm_per_N": np.array([[1e-5]]), "preload_N": np.array([[0.2 * scale]])}
    held = start(setting, rows(setting, 4))._replace(guide=scale * np.array([[0.1, 0.2, 0.6, 1.0]]))
    moved = effect("rig_compliance:preload").apply(held, values, setting).displacement - held.displacement
    np.testing.assert_allclose(moved, 1e-5 * scale * np.array([[0.0, 0.0, 0.5, 1.0]]), atol=1e-15)
