"""A blueprint goes to JSON and back unchanged, and holds nothing of the forces but where pulling begins.

Of a tensile test's stresses it holds the scale, where the rubber is stiffer than silicones are.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydantic import ValidationError

from mpam_calib.model.blueprint import Blueprint, MaterialPosterior, Options, draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.model.tensile import STRESS_SCALE
from mpam_calib.specimen.declaration import Fit, Geometry, GeometrySd, Noise, Sensors
from mpam_calib.specimen.recording import BlockedForce, ForceMap, FreeContraction, Loops, Tensile

from . import build

MATERIAL = MaterialPosterior(
    mean=(4e4, 1.0 / 3.0), covariance=((1e6, 0.1), (0.1, 7.0)), strain_range=(0.0, 1.0), convention="stretch"
)
TENSILE = Tensile(np.linspace(-0.1, 2.0, 30), np.linspace(-1e3, 1e5, 30))
ONE_FACTOR = (1.128e6, 27050.0, 3.1)
CASES = {
    "loops": build.blueprint({"law": "linear", "order": 4}),
    "everything": build.blueprint(
        {"law": "exponential_each", "order": 3, "friction": "strand", "effects": ("dead_band", "tip_shape")},
        Options(correlated_noise=False, remainder=True, nuisances=False),
        sensors=Sensors(force_sd_N=0.1 + 0.2, pressure_bias_sd_kPa=22.5, force_floor_N=0.0),
        geometry=Geometry(
            L0_mm=50.1, R0_mm=3.3, t0_mm=0.7, alpha0_deg=72.1, sd=GeometrySd(alpha0_deg=1.0, L0_mm=0.1)
        ),
        free_contraction=FreeContraction(np.array([1e5]), np.array([0.3])),
    ),
    "tensile": build.blueprint(
        {"moduli": "tensile", "order": 2, "law": "constant"},
        tensile=TENSILE,
        fit=Fit(tensile_strain=(0.1, 1.3)),
    ),
    "material": build.blueprint({"moduli": "run:../other", "order": 2, "law": "constant"}, material=MATERIAL),
}


@pytest.mark.parametrize("case", CASES)
def test_there_and_back(case):
    drawn = CASES[case]
    again = Blueprint.model_validate_json(drawn.model_dump_json())
    assert again == drawn
    assert again.model_dump_json() == drawn.model_dump_json()
    first, second = build_model(drawn), build_model(again)
    assert first.parameters == second.parameters
    assert first.linear_sizes == second.linear_sizes
    u = np.random.default_rng(0).standard_normal((3, len(first.names)))
    values = first.values(u)
    a, b = (m.moduli.transform(values) for m in (first, second))
    assert np.array_equal(a[0], b[0])
    assert np.array_equal(a[1], b[1])


def test_a_blueprint_cannot_be_changed():
    with pytest.raises(ValidationError):
        CASES["loops"].stroke = 1.0


def test_an_unknown_key_is_refused():
    text = CASES["loops"].model_dump_json().replace('"stroke":', '"stoke":')
    with pytest.raises(ValidationError):
        Blueprint.model_validate_json(text)


def test_it_does_not_know_the_forces():
    made = build.specimen({"law": "linear", "order": 3}, build.loops())
    rng = np.random.default_rng(0)
    forces = [40.0 + 10.0 * rng.standard_normal(72) for _ in range(2)]
    drawn = [draw_blueprint(build.with_force(made, np.maximum(f, 5.0))) for f in forces]
    assert drawn[0] == drawn[1]


def test_where_pulling_begins_is_a_pressure_with_a_clear_pull():
    made = build.specimen({"law": "linear", "order": 3}, build.loops((50.0, 100.0, 200.0)))
    assert made.loops is not None
    pulling = np.where(made.loops.level > 0, 30.0, 0.1)
    assert draw_blueprint(build.with_force(made, pulling)).pulls_at == pytest.approx(1e5)
    assert draw_blueprint(build.with_force(made, np.full(72, 30.0))).pulls_at == pytest.approx(5e4)


def test_a_pull_without_pressure_or_beyond_the_rest_length_says_nothing():
    """A bladder that is stretched pulls by itself, and so does one at 0 kPa."""
    made = build.specimen({"law": "linear", "order": 3}, build.loops((0.0, 50.0, 100.0, 150.0)))
    loops = made.loops
    assert loops is not None
    away = loops.displacement_m - loops.displacement_m.min() - 1e-3
    made = replace(made, loops=replace(loops, displacement_m=away))
    stretched = away < 0.0
    assert set(loops.level[stretched]) == {0, 1, 2, 3}
    pull = np.where(stretched | (loops.level == 0) | (loops.level > 1), 30.0, 0.1)
    assert draw_blueprint(build.with_force(made, pull)).pulls_at == pytest.approx(1e5)


def test_a_level_that_comes_back_is_held_anew():
    """100, 200 and again 100 kPa, of 24 rows each: 2.3 s, not from the first to the last."""
    recorded = build.loops((100.0, 200.0, 100.0))
    assert np.array_equal(np.unique(recorded.level), [0, 1, 2])
    recorded = replace(recorded, level=np.where(recorded.level == 2, 0, recorded.level))
    drawn = draw_blueprint(build.with_force(build.specimen(None, recorded), np.full(72, 9.0)))
    assert drawn.level_time == pytest.approx(2.3)


def test_a_single_reading_has_a_time():
    one = build.loops((100.0,), rows=1)
    one = Loops(**{k: v[:1] if isinstance(v, np.ndarray) else v for k, v in vars(one).items()})
    made = build.with_force(build.specimen(None, one), np.full(1, 9.0))
    assert np.isfinite(draw_blueprint(made).reading_time)


def test_a_free_contraction_far_from_all_levels_reaches_none():
    recorded = build.loops((100.0, 200.0))
    free = FreeContraction(np.array([2.005e5, 4e5]), np.array([0.25, 0.35]))
    made = build.specimen(None, recorded, free_contraction=free)
    reach = draw_blueprint(build.with_force(made, np.full(48, 9.0))).reach
    assert reach == pytest.approx((0.2 * 11.5 / 12, 0.25))
    alone = build.specimen(None, None, levels_kPa=(200.0, 390.0), free_contraction=free)
    assert draw_blueprint(alone).reach == pytest.approx((0.25, 0.35))


def test_a_level_without_contractions_reaches_as_far_as_its_neighbours() -> None:
    """Blocked forces every 10 kPa, free contractions every 50: between these nothing is extrapolated."""
    pressures = np.arange(0.0, 251e3, 10e3)
    blocked = BlockedForce(pressures, 2e-4 * pressures, np.zeros(26, dtype=bool))
    free = FreeContraction(np.arange(50e3, 201e3, 50e3), np.array([0.06, 0.14, 0.2, 0.24]))
    made = build.specimen(
        None, None, levels_kPa=tuple(pressures / 1e3), blocked_force=blocked, free_contraction=free
    )
    reach = np.array(draw_blueprint(made).reach)
    between = (pressures >= 50e3) & (pressures <= 200e3)
    assert reach[between] == pytest.approx(
        np.interp(pressures[between], free.pressure_Pa, free.contraction), abs=1e-12
    )
    assert not reach[~between].any()


def test_a_level_that_is_slack_everywhere_reaches_nowhere() -> None:
    P, gamma = (x.ravel() for x in np.meshgrid([5e4, 1e5, 1.5e5], [0.0, 0.1, 0.2], indexing="ij"))
    level = np.repeat([0, 1, 2], 3)
    slack = level == 1
    grid = ForceMap(P, gamma, np.where(slack, 0.0, 9.0), level, np.zeros(9, dtype=np.int64), slack)
    made = build.specimen(None, None, levels_kPa=(50.0, 100.0, 150.0), force_map=grid)
    assert draw_blueprint(made).reach == (0.2, 0.0, 0.2)


def test_stroke_reach_and_times():
    recorded = build.loops((100.0, 200.0), strokes_mm=(6.0, 12.0), rows=10, dt=0.2)
    drawn = draw_blueprint(build.with_force(build.specimen(None, recorded), np.full(40, 9.0)))
    assert drawn.stroke == pytest.approx(12e-3 * 9.5 / 10)
    assert drawn.reach == pytest.approx((0.12 * 9.5 / 10, 0.24 * 9.5 / 10))
    assert drawn.stroke_time == pytest.approx(0.2 * 9)
    assert drawn.levels == (1e5, 2e5)
    assert drawn.branches


def test_the_tensile_range():
    made = build.specimen(
        {"moduli": "tensile", "order": 2, "law": "constant"}, build.loops(), tensile=TENSILE
    )
    made = build.with_force(made, np.full(72, 9.0))
    assert draw_blueprint(made).tensile_range == (0.0, 2.0)
    narrowed = replace(made, fit=Fit(tensile_strain=(0.1, 1.3)))
    assert draw_blueprint(narrowed).tensile_range == (0.1, 1.3)


def test_the_stresses_of_a_usual_rubber_do_not_matter() -> None:
    soft, strain = CASES["tensile"], TENSILE.strain
    assert soft.tensile_stiffness == STRESS_SCALE == 1e6
    for rise, scale in ((7e5, 1e6), (1.3e6, 1.3e6), (1e7, 1e7)):
        drawn = build.blueprint(
            {"moduli": "tensile", "order": 2, "law": "constant"},
            tensile=Tensile(strain, np.where(strain <= 1.3, rise, 9e9) * strain),
            fit=Fit(tensile_strain=(0.1, 1.3)),
        )
        assert drawn.tensile_stiffness == pytest.approx(scale)


def test_a_blueprint_of_an_older_run_has_the_usual_scale() -> None:
    drawn = CASES["tensile"]
    text = drawn.model_dump_json()
    older = text.replace('"tensile_stiffness":1000000.0,', "")
    assert older != text
    assert Blueprint.model_validate_json(older) == drawn


@pytest.mark.parametrize(
    ("options", "gone"),
    [
        (Options(remainder=False), {"remainder_sd_N", "stroke_remainder_sd_N"}),
        (Options(correlated_noise=False), {"noise_corr_sd_N", "noise_corr_time_s"}),
        (Options(nuisances=False), {"alpha0_deg", "pressure_bias_kPa"}),
    ],
)
def test_options_leave_out_what_they_name(options, gone):
    parts = {
        "geometry": Geometry(
            L0_mm=50.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=72.0, sd=GeometrySd(alpha0_deg=1.0)
        ),
        "sensors": Sensors(force_sd_N=0.2, pressure_bias_sd_kPa=5.0),
    }
    full = build_model(build.blueprint({"law": "linear", "order": 2}, **parts))
    less = build_model(build.blueprint({"law": "linear", "order": 2}, options, **parts))
    assert set(full.names) - set(less.names) == gone


def test_noise_is_declared() -> None:
    """Nothing by default; each option of [noise] adds one parameter and survives JSON."""
    plain = build.blueprint({"law": "linear", "order": 2})
    before = set(build_model(plain).names)
    for noise, added in (
        (Noise(growth=True), {"noise_growth"}),
        (Noise(robust=True), {"noise_dof"}),
        (Noise(growth=True, robust=True), {"noise_growth", "noise_dof"}),
    ):
        declared = build.blueprint({"law": "linear", "order": 2}, noise=noise)
        assert Blueprint.model_validate_json(declared.model_dump_json()) == declared
        assert set(build_model(declared).names) - before == added


@pytest.mark.parametrize("rel_sd", [0.3, 0.0])
def test_moduli_that_move_as_one_keep_their_covariance(rel_sd: float) -> None:
    """A run with declared E_Pa leaves one common factor: a singular covariance."""
    mean = np.array(ONE_FACTOR)
    covariance = rel_sd**2 * np.outer(mean, mean)
    left = MaterialPosterior(
        mean=ONE_FACTOR,
        covariance=tuple(map(tuple, covariance.tolist())),
        strain_range=None,
        convention="stretch",
    )
    declared = {"moduli": "run:other", "order": 3, "law": "constant"}
    model = build_model(build.blueprint(declared, material=left))
    assert model.moduli is not None
    found, (_, root) = model.moduli.mean, model.moduli.transform({})
    np.testing.assert_allclose(found, mean)
    np.testing.assert_allclose(root[0] @ root[0].T, covariance, rtol=1e-9)
