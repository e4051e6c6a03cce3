"""Other authors' equations: nothing at size zero, finite at odd shapes, near the effect's own in mid-data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.model.chain import Chain
from mpam_calib.model.curves import box_cox
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.model.moduli import Law, ModuliBlock
from mpam_calib.model.readings import FAR, TIMES, Readings
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHAPES
from mpam_calib.physics.statics import axial_lever, hoop_lever, strains
from mpam_calib.specimen.effect_ids import forms_of_id
from mpam_calib.units import si_factor, unit_of

from . import build

FORMS = sorted(f"{e}:{form}" for e in known_effects() for form in effect(e).sources)
SHAPED = [f for f in FORMS if f.partition(":")[2] in effect(f.partition(":")[0]).own]
LEVELS = (100.0, 150.0, 200.0, 250.0)
DURATION, LEVEL_TIME, SPEED = 300.0, 60.0, 1e-3
MODULI = np.array([6e4, 2e4])
AWAY = {
    # Friction is as declared at the mean speed, and a law as declared in the middle.
    "rate_friction": {"speed": 4.0 * SPEED, "pace": 4.0 * SPEED},
    "law_shape": {"pressure": 1e3 * LEVELS[-1]},
    # Half-way a fit to all strains may leave nothing; most it leaves beyond them.
    "order_too_low": {"displacement": 0.011},
    # After a turn a supply has hardly anything to refill; a droop is stated for full stroke.
    "pressure_droop": {"travel": 5e-3, "displacement": 5.5e-3},
}


def setting_for(form: str, law: str = "constant") -> Setting:
    identifier = form.partition(":")[0]
    kinematics = "constant_thickness" if identifier == "braid_kinematics" else "inextensible_braid"
    friction = "strand" if identifier == "coulomb_friction" else "coulomb"
    declared = {"law": law, "order": 2, "kinematics": kinematics, "friction": friction, "effects": (form,)}
    setting = build.blueprint(declared, recorded=build.loops(LEVELS)).setting()
    assert setting is not None
    strokes = setting.stroke * np.linspace(0.6, 1.0, len(LEVELS))
    return replace(setting, duration=DURATION, level_time=LEVEL_TIME, speed=SPEED, strokes=strokes)


def without(setting: Setting) -> Setting:
    return replace(setting, simulation=setting.simulation.model_copy(update={"effects": ()}))


def force(setting: Setting, values: dict[str, np.ndarray], readings: Readings) -> np.ndarray:
    law = Law("constant", len(MODULI), setting.levels)
    chain = Chain(setting, ModuliBlock(law, 0.0, mean=MODULI, root=np.zeros((len(MODULI), 1))), False)
    count = max((len(v) for v in values.values()), default=1)
    declared = {"K_f": np.full((count, 1), 0.06), "f_s": np.full((count, 1), 0.2)}
    found = chain.force({**declared, **values}, np.zeros((count, 1)), readings)
    return np.broadcast_to(found, (count, len(readings)))


def rows(setting: Setting, count: int = 60) -> Readings:
    """Rows all over the recordings, from the very start of every clock and stroke."""
    rng = np.random.default_rng(2)
    share = np.linspace(0.0, 1.0, count)
    time_at_level = LEVEL_TIME * rng.permutation(share)
    cycle = 1.0 + np.arange(count) % 4
    return Readings(
        pressure=rng.permutation(np.linspace(setting.levels[0], setting.top_pressure, count)),
        displacement=np.linspace(-0.01, 1.0, count) * setting.stroke,
        sign=np.where(np.arange(count) % 2, 1.0, -1.0),
        level=np.zeros(count, dtype=np.int64),
        time=DURATION * share,
        file_time=DURATION * share,
        time_at_level=time_at_level,
        cycle=cycle,
        test_cycle=cycle + 3.0 * (share > 0.5),
        travel=1e-6 + rng.permutation(share) * setting.stroke,
        reversal=np.where(share > 0.2, 1.0, 0.0),
        strokes_before=np.full((count, 2), FAR),
        speed=SPEED * 10.0 ** (2.0 * rng.permutation(share) - 1.0),
        behind=rng.permutation(share) * setting.stroke,
        relaxed=-np.expm1(-time_at_level[:, None] / TIMES),
        pace=SPEED * 10.0 ** (2.0 * rng.permutation(share) - 1.0),
    )


def middle(setting: Setting, **away: float) -> Readings:
    """One reading in the middle of everything, on a level's first stroke."""
    values = {
        "pressure": 0.5 * (setting.levels[0] + setting.top_pressure),
        "displacement": 0.5 * setting.stroke,
        "sign": -1.0,
        "level": 0,
        "time": 0.5 * DURATION,
        "file_time": 0.5 * DURATION,
        "time_at_level": 0.5 * LEVEL_TIME,
        "cycle": 1.0,
        "test_cycle": 1.0,
        "travel": 0.02 * setting.stroke,
        "reversal": 1.0,
        "strokes_before": (FAR, FAR),
        "speed": SPEED,
        "pace": SPEED,
        "behind": 0.0,
        "relaxed": -np.expm1(-0.5 * LEVEL_TIME / TIMES),
    }
    return Readings(**{name: np.array([value]) for name, value in (values | away).items()})


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


def start(setting: Setting, readings: Readings) -> State:
    return Chain(setting, None, False).start(readings, np.zeros(1))


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


def test_a_fit_of_too_low_an_order_leaves_what_least_squares_leave() -> None:
    setting = setting_for("order_too_low:fitted")
    readings, hardening, reach = replace(rows(setting), sign=np.zeros(60)), 0.7, 0.3
    values = {"next_order": 0.1, "hardening": hardening, "tested_strain": reach}
    there = force(setting, {k: np.full((1, 1), v) for k, v in values.items()}, readings)[0]
    found = there - force(without(setting), {}, readings)[0]

    def wall(strain: np.ndarray) -> np.ndarray:
        return strain**3 * np.exp(hardening * strain)

    tested = np.linspace(0.0, reach, 41)[1:]
    fitted = np.linalg.lstsq(np.stack([tested, tested**2], axis=1), wall(tested), rcond=None)[0]
    rest = start(setting, readings).rest
    shape = SHAPES["inextensible_braid"](rest.L0 - readings.displacement, rest)
    axial, hoop = (wall(s) - np.polyval([*fitted[::-1], 0.0], s) for s in strains(shape, rest, "engineering"))
    expected = (axial_lever(shape) * axial - hoop_lever(shape) * hoop)[0]
    np.testing.assert_allclose(found / expected, np.median(found / expected), rtol=1e-6)


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
    law = Law("constant", len(MODULI), setting.levels)
    chain = Chain(setting, ModuliBlock(law, 0.0, mean=MODULI, root=np.zeros((len(MODULI), 1))), False)
    found = chain.terms(values, at, bare[0])
    np.testing.assert_allclose(found.fixed, np.exp(angle * s) * bare, rtol=1e-12)


@pytest.mark.parametrize("form", ["thickness", "thin", "section"])
def test_a_wall_lies_within_the_strands_as_thick_as_its_law_says(form: str) -> None:
    setting = setting_for(f"braid_kinematics:{form}")
    state = effect(f"braid_kinematics:{form}").apply(start(setting, rows(setting)), {}, setting)
    rest = state.rest
    shape = SHAPES[state.kinematics](rest.L0 * np.array([1.0, 0.9, 0.8]), rest)
    np.testing.assert_allclose(shape.t[:, :1], rest.t0)
    kept = {
        "thickness": shape.t,
        "thin": shape.t * shape.R * shape.L,
        "section": shape.t * shape.R,
    }[form]
    np.testing.assert_allclose(kept, kept[:, :1] + np.zeros((1, 3)))
    np.testing.assert_allclose(shape.R[:, :1], rest.R0)
    # The strands' length stays: L² + (2πN R)² with R0 tan α0 for L0 / (2πN).
    turned = rest.L0 / (rest.R0 * np.tan(rest.alpha0))
    strands = np.hypot(shape.L, turned * shape.R)
    np.testing.assert_allclose(strands, strands[:, :1] + np.zeros((1, 3)))


def test_a_preloaded_fixture_is_stiff_up_to_its_preload() -> None:
    setting = setting_for("rig_compliance:preload")
    scale = setting.force_scale
    values = {"compliance_mm_per_N": np.array([[1e-5]]), "preload_N": np.array([[0.2 * scale]])}
    held = start(setting, rows(setting, 4))._replace(guide=scale * np.array([[0.1, 0.2, 0.6, 1.0]]))
    moved = effect("rig_compliance:preload").apply(held, values, setting).displacement - held.displacement
    np.testing.assert_allclose(moved, 1e-5 * scale * np.array([[0.0, 0.0, 0.5, 1.0]]), atol=1e-15)


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
