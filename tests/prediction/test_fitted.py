"""What a report calls the simulation's miss is what no parameter of it could have taken up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from model import build

from mpam_calib.calibration import calibrate
from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.bands import stress_draws
from mpam_calib.prediction.fitted import _directions, _taken_up, fitted_force, fitted_stress
from mpam_calib.run.view import view_of
from mpam_calib.specimen import read

ROOT = Path(__file__).resolve().parents[2]


def test_only_what_the_parameters_cannot_describe_is_left():
    x = np.linspace(-1.0, 1.0, 201)
    columns = 10.0 * np.stack([np.ones_like(x), x])
    ripple = np.sin(40.0 * x) - np.sin(40.0 * x) @ x / (x @ x) * x
    surface = np.stack([3.0 + 2.0 * x + ripple, ripple])
    left = surface - _taken_up(surface, columns, 0.1)
    np.testing.assert_allclose(left, np.stack([ripple, ripple]), atol=1e-3)


def test_the_miss_of_a_rubbers_law_is_that_of_its_least_squares_fit():
    specimen = read(ROOT / "datasets" / "ecoflex_tension")
    calibration = calibrate(specimen)
    view = view_of(calibration, calibration.bands())
    data = calibration.target.data.tensile
    assert data is not None
    powers = np.stack([data.strain, data.strain**2], axis=1)
    fitted = powers @ np.linalg.lstsq(powers, data.stress, rcond=None)[0]
    plain = float(np.sqrt(np.mean((data.stress - fitted) ** 2)))
    # 1,733 Pa in both ways; the amplitude of the remainder, with what the moduli share, is four times that.
    assert abs(view.remainder / plain - 1.0) < 0.05


def test_the_simulation_and_what_it_leaves_make_up_the_whole_force():
    """Of draws that are all one: what the simulation took of the remainder is not left, too."""
    made = build.with_force(build.specimen(None, build.loops()), np.full(72, 10.0))
    model = build_model(draw_blueprint(made))
    assert model.chain is not None
    eta = np.tile(np.random.default_rng(3).standard_normal(sum(model.linear_sizes)), (4, 1))
    u = np.zeros((4, len(model.names)))
    draws = Draws(u, model.values(u), eta, 1)
    readings = build.rows_of(made.loops)
    whole = predict_force(model, draws.values, eta, readings)[0]
    bare = model.chain.force(draws.values, eta[:, : model.linear_sizes[0]], readings)[0]
    fitted, square = fitted_force(model, draws, readings)
    np.testing.assert_allclose(square, (whole - fitted) ** 2, atol=1e-9)
    assert square.mean() < 0.9 * np.mean((whole - bare) ** 2)


def test_directions_are_newtons_for_each_standard_normal_coordinate():
    """Without friction the force is straight in the moduli's; in the dead-band's it is nearly so."""
    declared = {"law": "linear", "order": 2, "friction": "none", "effects": ("dead_band",)}
    made = build.with_force(build.specimen(declared, build.loops()), np.full(72, 10.0))
    model = build_model(draw_blueprint(made, build.PLAIN))
    assert model.chain is not None
    u, eta = np.zeros((4, len(model.names))), np.zeros((4, sum(model.linear_sizes)))
    readings = build.rows_of(made.loops)
    found = _directions(model, Draws(u, model.values(u), eta, 1), readings)
    columns = model.chain.terms(model.values(u[:1]), readings).columns[0]
    np.testing.assert_allclose(found[1:], columns.T, rtol=1e-9, atol=1e-9)
    at = [np.where(np.array(model.names) == "P_DB_kPa", side, 0.0)[None] for side in (-0.01, 0.01)]
    low, high = (
        model.chain.force(model.values(point), eta[:1, : columns.shape[1]], readings) for point in at
    )
    np.testing.assert_allclose(found[0], (high - low)[0] / 0.02, rtol=0.1, atol=0.1)
    assert np.abs(found[0]).max() > 2.0


def test_so_do_a_rubbers_law_and_what_it_leaves():
    specimen = read(ROOT / "datasets" / "ecoflex_tension")
    model = build_model(draw_blueprint(specimen))
    eta = np.tile(np.random.default_rng(3).standard_normal(sum(model.linear_sizes)), (4, 1))
    u = np.zeros((4, len(model.names)))
    draws = Draws(u, model.values(u), eta, 1)
    assert model.tensile is not None
    strain = np.linspace(model.tensile.low, model.tensile.high, 50)
    whole, law = (stress_draws(model, draws, strain, remainder=r)[0] for r in (True, False))
    stress, square = fitted_stress(model, draws, strain)
    np.testing.assert_allclose(square, (whole - stress) ** 2, rtol=1e-6, atol=1e-6)
    assert square.mean() < 0.9 * np.mean((whole - law) ** 2)
