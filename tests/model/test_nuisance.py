"""Declared uncertainties: no sampled muscle lies beyond what can exist."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.model.nuisance import nuisance_parameters
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.specimen.declaration import Geometry, GeometrySd

from . import build

U = np.linspace(-6.0, 6.0, 241)


def parameter(name: str, value: float, sd: float) -> Parameter:
    """The one parameter of a muscle of which one dimension is uncertain."""
    values = {"L0_mm": 50.0, "R0_mm": 3.0, "t0_mm": 0.7, "alpha0_deg": 72.0, name: value}
    geometry = Geometry(**values, sd=GeometrySd(**{name: sd}))
    setting = build.blueprint({"law": "linear", "order": 2}, geometry=geometry).setting()
    assert setting is not None
    (found,) = nuisance_parameters(setting)
    return found


def test_no_braid_lies_flatter_than_the_axis() -> None:
    prior = parameter("alpha0_deg", 86.0, 3.0).prior
    drawn = np.degrees(prior.from_normal(U))
    assert drawn.max() < 90.0 and np.all(np.diff(drawn) > 0.0)
    # Where no bound is near it is as wide as declared.
    assert np.degrees(prior.from_normal(np.array([-3.0])))[0] == pytest.approx(86.0 - 9.0, abs=0.6)


def test_no_wall_is_thinner_than_nothing() -> None:
    drawn = parameter("t0_mm", 0.7, 0.4).prior.from_normal(U)
    assert drawn.min() > 0.0 and np.all(np.diff(drawn) > 0.0)


def test_far_bounds_leave_the_plain_normal() -> None:
    assert parameter("alpha0_deg", 72.0, 1.0).prior == Normal(np.radians(72.0), np.radians(1.0))
    thickness = parameter("t0_mm", 0.7, 0.05).prior
    assert isinstance(thickness, Normal)
    assert (thickness.mean, thickness.scale) == pytest.approx((0.7e-3, 0.05e-3))
