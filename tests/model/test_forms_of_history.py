"""Forms of what happened so far and of the moduli's law, each against the law that it is named after."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import special

from mpam_calib.model.effect import effect
from mpam_calib.model.readings import TIMES

from .forms import applied, before_and_after, driven, one, rows, setting_for, shaped, start


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


@pytest.mark.parametrize("power", [0.4, 1.0, 1.5])
def test_a_stretched_relaxation_is_kohlrausch_s(power: float) -> None:
    """ln(−ln(what is left)) rises with ln t by the power, whatever the size."""
    before, after = before_and_after(
        "creep:stretched", creep_per_decade=0.05, relaxation_s=20.0, creep_stretch=power
    )
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
    _, anew = before_and_after(f"stress_softening:{kind.strip('-')}".strip(":"), first_cycle_fraction=0.3)
    _, once = before_and_after(f"stress_softening:test-{kind}".strip("-"), first_cycle_fraction=0.3)
    own = {"softening_recovers": recovers, "softening_cycles": 1.0}
    _, found = before_and_after(f"stress_softening:{form}", first_cycle_fraction=0.3, **own)
    for name in ("gain", "wall_gain"):
        mixed = recovers * getattr(anew, name) + (1.0 - recovers) * getattr(once, name)
        np.testing.assert_allclose(getattr(found, name), mixed)
    # Slower, what is left falls by the same factor with every cycle.
    own = {"softening_recovers": 1.0, "softening_cycles": 2.5}
    before, slow = before_and_after(f"stress_softening:{form}", first_cycle_fraction=0.3, **own)
    left = (slow.gain * slow.wall_gain)[0] - 1.0
    np.testing.assert_allclose(left, 0.3 * np.exp((1.0 - before.readings.cycle) / 2.5))


@pytest.mark.parametrize("form", ["growing", "force-growing"])
def test_softening_may_grow_with_the_stretch(form: str) -> None:
    """The ends of the stroke differ by the growth, every cycle by the same factor."""
    values = {"first_cycle_fraction": 0.2, "softening_growth": 1.2, "softening_cycles": 1.5}
    before, after = before_and_after(f"stress_softening:{form}", **values)
    left = np.ravel(after.gain * after.wall_gain - 1.0) * np.exp((before.readings.cycle - 1.0) / 1.5)
    along = np.ravel(before.displacement) / before.displacement.max()
    np.testing.assert_allclose(np.polynomial.polynomial.polyfit(along, left, 1), [0.08, 0.24], rtol=1e-9)


def test_a_law_may_bend_in_proportion_to_the_pressure() -> None:
    before, after = before_and_after("law_shape:line", law_bend_1=0.3)
    bend, pressure = np.ravel(after.wall_gain) - 1.0, np.ravel(before.pressure)
    np.testing.assert_allclose(bend / bend[0], pressure / pressure[0], rtol=1e-12)


@pytest.mark.parametrize("exponent", [0.5, 2.0])
def test_a_law_may_bend_by_a_power_of_the_pressure(exponent: float) -> None:
    before, after = before_and_after("law_shape:power", law_bend_1=0.3, law_exponent=exponent)
    bend, pressure = np.ravel(after.wall_gain) - 1.0, np.ravel(before.pressure)
    np.testing.assert_allclose(bend / bend[0], (pressure / pressure[0]) ** exponent, rtol=1e-12)


@pytest.mark.parametrize("rate", [-3.0, -0.5, 1.0, 4.0])
def test_a_law_s_curve_is_an_exponential_but_for_the_law(rate: float) -> None:
    """What a line in pressure leaves of e^(κx) is the form's curve, up to a factor."""
    setting = setting_for("law_shape:exponential", "linear")
    readings = rows(setting)
    values = {"law_bend_2": np.array([[0.2]]), "law_curvature": np.array([[rate]])}
    gain = effect("law_shape:exponential").apply(start(setting, readings), values, setting).wall_gain[0]
    x = (2.0 * readings.pressure - setting.levels[0] - setting.top_pressure) / np.ptp(setting.levels)
    basis = np.stack([np.ones_like(x), x, gain - 1.0], axis=1)
    target = np.exp(rate * x)
    found = basis @ np.linalg.lstsq(basis, target, rcond=None)[0]
    np.testing.assert_allclose(found, target, atol=2e-4 * np.ptp(target))


def test_a_law_at_its_natural_size_is_its_lowest_bend() -> None:
    setting = setting_for("law_shape:exponential", "linear")
    readings = rows(setting)
    one = {"law_bend_2": np.array([[0.2]]), "law_curvature": np.zeros((1, 1)), "law_bend_3": np.zeros((1, 1))}
    gains = [
        effect(form).apply(start(setting, readings), one, setting).wall_gain
        for form in ("law_shape", "law_shape:exponential")
    ]
    np.testing.assert_allclose(gains[0], gains[1], rtol=1e-12)


@pytest.mark.parametrize("form", ["law_shape", "law_shape:exponential"])
def test_moduli_of_a_tensile_test_may_be_higher_on_average_under_pressure(form: str) -> None:
    setting = setting_for(form, "constant")
    tensile = setting.simulation.model_copy(update={"moduli": "tensile"})
    known = replace(setting, simulation=tensile)
    free, names = ([p.name for p in effect(form).parameters(s)] for s in (setting, known))
    assert "law_bend_0" not in free  # free moduli have their mean themselves
    assert set(names) == {*free, "law_bend_0"}
    values = {name: np.zeros((1, 1)) for name in names} | {"law_bend_0": np.array([[0.4]])}
    gain = effect(form).apply(start(known, rows(known)), values, known).wall_gain
    np.testing.assert_allclose(gain, 1.4)
