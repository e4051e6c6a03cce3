"""Other authors' forms against the law that each is named after."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import special

from mpam_calib.model.effect import effect
from mpam_calib.model.readings import TIMES
from mpam_calib.model.state import State
from mpam_calib.physics.kinematics import SHAPES, radius_inextensible_braid

from .test_history_forms import driven, one
from .test_literature_forms import force, middle, rows, setting_for, start, without

ATMOSPHERE = 101325.0


def applied(form: str, **values: float) -> tuple[State, State]:
    """The state before and after a form, over readings all along the recordings."""
    setting = setting_for(form)
    before = start(setting, rows(setting))
    return before, effect(form).apply(before, {k: one(v) for k, v in values.items()}, setting)


@pytest.mark.parametrize("droop", [0.02, 0.1, 0.3])
def test_a_supply_that_is_shut_off_follows_boyle(droop: float) -> None:
    """One volume of the supply for all levels: (P + P_atm)·(V_supply + ΔV) stays; no braid, no droop."""
    form = "pressure_droop:reservoir"
    setting = setting_for(form)
    before, after = applied(form, droop_percent=droop)
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
    before, after = applied("pressure_droop:loss", droop_percent=0.05, loss_exponent=exponent)
    lost, x = before.pressure - after.pressure, before.displacement
    rate = np.ravel(lost / x / before.pressure**exponent)
    np.testing.assert_allclose(rate, rate[0], rtol=1e-9)


def rubbing(form: str, share: float, pressure: float, **values: float) -> float:
    """Friction (N) of strands alone at a share of the stroke, on the way in."""
    setting = setting_for(form)
    known = {"K_f": one(0.0), **{name: one(value) for name, value in values.items()}}
    at = middle(setting, displacement=share * setting.stroke, pressure=pressure)
    return -float((force(setting, known, at) - force(without(setting), {"K_f": one(0.0)}, at))[0, 0])


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


def test_a_wall_s_share_may_go_with_the_pressure() -> None:
    form = "wall_pressure:pressed"
    before, after = applied(form, wall_factor=0.4, wall_exponent=0.7)
    missing = 1.0 - after.wall_factor
    ratio = before.pressure / before.pressure[..., :1]
    np.testing.assert_allclose(missing, missing[..., :1] * ratio**0.7, rtol=1e-12)


def test_a_wall_s_share_may_settle_as_it_seats() -> None:
    before, after = applied("wall_pressure:seated", wall_factor=0.4, seating_kPa=6e4)
    missing = np.ravel(1.0 - after.wall_factor)
    pressure = np.ravel(before.pressure)
    share = 1.0 - np.exp(-pressure / 6e4)
    np.testing.assert_allclose(missing / missing[0], share / share[0], rtol=1e-12)


def test_a_law_may_bend_in_proportion_to_the_pressure() -> None:
    before, after = applied("law_shape:line", law_bend_1=0.3)
    bend, pressure = np.ravel(after.wall_gain) - 1.0, np.ravel(before.pressure)
    np.testing.assert_allclose(bend / bend[0], pressure / pressure[0], rtol=1e-12)


def test_a_supply_may_lose_with_the_square_of_the_stroke() -> None:
    before, after = applied("pressure_droop:square", droop_percent=0.1)
    lost = np.ravel(1.0 - after.pressure / before.pressure)
    place = np.ravel(before.displacement) / before.displacement.max()
    np.testing.assert_allclose(lost, 0.1 * place * np.abs(place), atol=1e-15)


@pytest.mark.parametrize("exponent", [0.5, 2.0])
def test_a_law_may_bend_by_a_power_of_the_pressure(exponent: float) -> None:
    before, after = applied("law_shape:power", law_bend_1=0.3, law_exponent=exponent)
    bend, pressure = np.ravel(after.wall_gain) - 1.0, np.ravel(before.pressure)
    np.testing.assert_allclose(bend / bend[0], (pressure / pressure[0]) ** exponent, rtol=1e-12)


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


def test_strands_that_stretch_grow_longer_and_store_energy() -> None:
    """What the shape loses and what the force loses, both from one factor."""
    form = "braid_stretch:both"
    setting = setting_for(form)
    before = start(setting, rows(setting))
    length = before.rest.L0 - before.displacement
    shaped = before._replace(length=length, shape=SHAPES[before.kinematics](length, before.rest))
    values = {"braid_factor": one(1.3)}
    both, longer, energy = (
        effect(f).apply(shaped, values, setting) for f in (form, "braid_stretch:longer", "braid_stretch")
    )
    assert both.shape is not None and longer.shape is not None
    np.testing.assert_array_equal(both.shape.R, longer.shape.R)
    np.testing.assert_array_equal(both.lost, energy.lost)
    assert np.all(both.lost > 0.0) and np.any(both.shape.R != shaped.shape.R)


@pytest.mark.parametrize("longest", [1.0, 1.7])
def test_damage_by_the_way_fades_exponentially_along_it(longest: float) -> None:
    """In one way for all levels, however long their strokes."""
    form = "stress_softening:path"
    setting = setting_for(form)
    readings = driven(setting)
    levels = np.full(len(setting.levels), setting.stroke)
    setting = replace(setting, strokes=levels, stroke=longest * setting.stroke)
    values = {"first_cycle_fraction": one(0.2), "softening_strokes": one(1.6)}
    gain = effect(form).apply(start(setting, readings), values, setting).wall_gain[0]
    way = np.cumsum(np.abs(np.diff(readings.displacement, prepend=0.0)))
    np.testing.assert_allclose((gain - 1.0) / 0.2, np.exp(-way / setting.stroke / 1.6), rtol=5e-3)


def test_what_is_stretched_anew_is_ogden_and_roxburgh_s() -> None:
    """Energies ∝ x²: erf of what is missing to the largest, less that to the largest so far."""
    form, reach = "stress_softening:fresh", 0.4
    setting = setting_for(form)
    readings = driven(setting)
    values = {"first_cycle_fraction": one(0.2), "softening_reach": one(reach)}
    gain = effect(form).apply(start(setting, readings), values, setting).wall_gain[0]
    energy = (readings.displacement / setting.stroke) ** 2
    so_far = np.maximum.accumulate(energy)
    expected = special.erf((1.0 - energy) / reach) - special.erf((so_far - energy) / reach)
    np.testing.assert_allclose((gain - 1.0) / 0.2, expected, atol=0.02)


@pytest.mark.parametrize("form", ["worn", "test-worn"])
@pytest.mark.parametrize(("reach", "power"), [(0.2, 0.5), (0.1, 1.0)])
def test_it_softens_by_an_exponential_of_the_way_to_the_farthest_so_far(
    form: str, reach: float, power: float
) -> None:
    setting = setting_for(f"stress_softening:{form}")
    readings = driven(setting)
    way = np.maximum.accumulate(readings.displacement) - readings.displacement
    readings = replace(readings, behind=way)
    setting = replace(setting, strokes=None, stroke=float(readings.displacement.max()))
    values = {
        "first_cycle_fraction": one(0.2), "softening_reach": one(reach), "softening_power": one(power),
    }  # fmt: skip
    gain = effect(f"stress_softening:{form}").apply(start(setting, readings), values, setting).wall_gain
    expected = np.exp(-((way / setting.stroke / reach) ** power))
    np.testing.assert_allclose((np.broadcast_to(gain, (1, len(way)))[0] - 1.0) / 0.2, expected, atol=1e-4)


@pytest.mark.parametrize("gap", [0.05, 0.2, 0.6])
def test_a_bladder_blown_up_to_the_braid_takes_a_thin_tube_s_pressure(gap: float) -> None:
    """Neo-Hookean, held in length: stress μ(λ² − λ⁻²) in a wall of t/λ at the radius λr."""
    before, after = applied("dead_band:balloon", P_DB_kPa=5e3, bladder_gap=gap)
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


@pytest.mark.parametrize("power", [0.4, 1.0, 1.5])
def test_a_stretched_relaxation_is_kohlrausch_s(power: float) -> None:
    """ln(−ln(what is left)) rises with ln t by the power, whatever the size."""
    before, after = applied("creep:stretched", creep_per_decade=0.05, relaxation_s=20.0, creep_stretch=power)
    time = before.readings.time_at_level
    end = 1.0 - np.exp(-((30.0 / 20.0) ** power))
    done = (1.0 - after.gain[0]) / (0.05 * np.log10(31.0)) * end
    seen = (time > 0.5) & (done < 1.0 - 1e-6)
    slope, at_one = np.polyfit(np.log(time[seen]), np.log(-np.log1p(-done[seen])), 1)
    assert slope == pytest.approx(power, rel=1e-6)
    assert np.exp(-at_one / slope) == pytest.approx(20.0, rel=1e-6)


@pytest.mark.parametrize("early", [0.0, 25.0])
def test_relaxations_since_every_step_hold_a_logarithm_and_a_single_one(early: float) -> None:
    """After steps up and down, each so many seconds before its level's first reading: log10(1 + t/1 s) of
    each to 0.03 decades, one dashpot to a twentieth."""
    setting = setting_for("creep:steps")
    steps, ages = np.array([150e3, -50e3, 120e3]), np.array([400.0, 260.0, 80.0])
    later = np.linspace(0.0, 60.0, 60)[:, None]
    pressure = steps.sum()
    readings = replace(
        rows(setting),
        pressure=np.full(60, pressure),
        relaxed=(steps[:, None] * -np.expm1(-(ages + later)[..., None] / TIMES)).sum(axis=1) / pressure,
    )

    def decades(time: float, spread: float) -> np.ndarray:
        values = {"creep_per_decade": 0.1, "relaxation_s": time, "relaxation_decades": spread}
        values["creep_before_s"] = early
        given = {name: one(value) for name, value in values.items()}
        return (1.0 - effect("creep:steps").apply(start(setting, readings), given, setting).gain[0]) / 0.1

    logarithm = np.log10(1.0 + ages + later + early) @ steps / pressure
    found = [decades(time, spread) for time in (10.0, 30.0, 60.0, 100.0, 200.0) for spread in (0.8, 1.0, 1.4)]
    left = [np.abs(f * np.mean(logarithm) / np.mean(f) - logarithm).max() for f in found]
    assert min(left) < 0.03 * np.ptp(logarithm) + 0.01
    single = -np.expm1(-(ages + later + early) / 50.0) @ steps / pressure
    narrow = decades(50.0, 0.05)
    assert np.abs(narrow * single.mean() / narrow.mean() - single).max() < 0.05 * single.max()


@pytest.mark.parametrize("form", ["recovering", "force-recovering"])
@pytest.mark.parametrize("recovers", [0.0, 0.4, 1.0])
def test_what_recovers_softens_anew_and_the_rest_stays(form: str, recovers: float) -> None:
    kind = form.rpartition("recovering")[0]
    _, anew = applied(f"stress_softening:{kind.strip('-')}".strip(":"), first_cycle_fraction=0.3)
    _, once = applied(f"stress_softening:test-{kind}".strip("-"), first_cycle_fraction=0.3)
    own = {"softening_recovers": recovers, "softening_cycles": 1.0}
    _, found = applied(f"stress_softening:{form}", first_cycle_fraction=0.3, **own)
    for name in ("gain", "wall_gain"):
        mixed = recovers * getattr(anew, name) + (1.0 - recovers) * getattr(once, name)
        np.testing.assert_allclose(getattr(found, name), mixed)
    # Slower, what is left falls by the same factor with every cycle.
    own = {"softening_recovers": 1.0, "softening_cycles": 2.5}
    before, slow = applied(f"stress_softening:{form}", first_cycle_fraction=0.3, **own)
    left = (slow.gain * slow.wall_gain)[0] - 1.0
    np.testing.assert_allclose(left, 0.3 * np.exp((1.0 - before.readings.cycle) / 2.5))


@pytest.mark.parametrize("form", ["growing", "force-growing"])
def test_softening_may_grow_with_the_stretch(form: str) -> None:
    """The ends of the stroke differ by the growth, every cycle by the same factor."""
    values = {"first_cycle_fraction": 0.2, "softening_growth": 1.2, "softening_cycles": 1.5}
    before, after = applied(f"stress_softening:{form}", **values)
    left = np.ravel(after.gain * after.wall_gain - 1.0) * np.exp((before.readings.cycle - 1.0) / 1.5)
    along = np.ravel(before.displacement) / before.displacement.max()
    np.testing.assert_allclose(np.polynomial.polynomial.polyfit(along, left, 1), [0.08, 0.24], rtol=1e-9)


def test_grips_bed_in_with_each_cycle() -> None:
    own = {"offset_mm": 2e-3, "offset_excess": -0.6, "bedding_cycles": 3.0}
    before, after = applied("length_offset:bedding", **own)
    moved = (after.displacement - before.displacement)[0]
    loaded = before.readings.test_cycle - 1.0
    np.testing.assert_allclose(moved, 2e-3 * (1.0 - 0.6 * np.exp(-loaded / 3.0)))


@pytest.mark.parametrize("sds", [-1.0, 1.0])
def test_a_gain_error_has_the_size_of_an_instrument_s(sds: float) -> None:
    """At one prior sd about 2 % of the reading; a fifth of it is no scale but the muscle's ends."""
    for form in ("length_offset:scale", "length_offset:line"):
        setting = setting_for(form)
        at = {p.name: float(p.prior.from_normal(np.array(sds))) for p in effect(form).parameters(setting)}
        before, after = applied(form, **at | {"offset_mm": abs(at["offset_mm"])})
        moved = np.ravel(after.displacement - before.displacement)
        slope, _ = np.polyfit(np.ravel(before.displacement), moved, 1)
        assert 0.015 < abs(slope) < 0.03
        fifth = {"offset_mm": 0.2 * 0.5 * setting.stroke, "scale_share": 1.0}
        away = {
            p.name: float(p.prior.to_normal(np.array(fifth[p.name])))
            for p in effect(form).parameters(setting)
        }
        assert max(map(abs, away.values())) > 4.0


def test_conical_ends_ease_as_tondu_and_lopez_have_it() -> None:
    """k = a·e^(−P) + b: what is linear in e^(−P/p) at every contraction; without a, the plain cone."""
    setting = setting_for("tip_shape:easing")
    before = start(setting, rows(setting))
    before = before._replace(length=before.rest.L0 - before.displacement)

    def contraction(form: str, **values: float) -> np.ndarray:
        after = effect(form).apply(before, {k: one(v) for k, v in values.items()}, setting)
        return np.ravel(before.rest.L0 - after.length) / np.ravel(before.displacement)

    own = {"tip_factor": 0.8, "easing_kPa": 9e4}
    k = contraction("tip_shape:easing", tip_eased_share=0.7, **own)
    fading = np.exp(-np.ravel(before.pressure) / 9e4)
    np.testing.assert_allclose(k, np.polyval(np.polyfit(fading, k, 1), fading), rtol=1e-9)
    assert k.max() - k.min() > 0.01
    plain = contraction("tip_shape:tapered", tip_factor=0.8)
    np.testing.assert_allclose(contraction("tip_shape:easing", tip_eased_share=0.0, **own), plain)
