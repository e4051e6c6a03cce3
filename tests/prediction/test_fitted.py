"""What a report calls the simulation's miss is what no parameter of it could have taken up."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mpam_calib.calibration import calibrate
from mpam_calib.prediction.fitted import _taken_up
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
