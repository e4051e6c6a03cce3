"""Declared uncertainties: no sampled muscle lies beyond what can exist."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.model.model import Model, build_model
from mpam_calib.model.nuisance import BIAS, nuisance_parameters
from mpam_calib.model.priors import Normal, NormalWithin, Parameter
from mpam_calib.model.readings import Readings
from mpam_calib.specimen.declaration import Geometry, GeometrySd, Sensors

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


def bare_force(made: Model, values: dict[str, float], pressure_kPa: float = 150.0) -> float:
    """Friction-free force (N) of gas and wall alone at 4 mm of contraction, for values in SI."""
    assert made.chain is not None
    known = made.values(np.zeros((1, len(made.names)))) | {n: np.full((1, 1), v) for n, v in values.items()}
    readings = Readings.at_rest(np.array([1e3 * pressure_kPa]), np.array([0.004]))
    return float(made.chain.force(known, np.zeros((1, made.linear_sizes[0])), readings)[0, 0])


def made_with(sensors: Sensors, sd: GeometrySd, effects: tuple[str, ...] = (), **declared: float) -> Model:
    values = {"L0_mm": 50.0, "R0_mm": 3.0, "t0_mm": 0.7, "alpha0_deg": 72.0, **declared}
    simulation = {"law": "linear", "order": 2, "effects": effects}
    geometry = Geometry(**values, sd=sd)
    return build_model(build.blueprint(simulation, build.PLAIN, geometry=geometry, sensors=sensors))


@pytest.mark.parametrize(
    ("name", "value", "si"),
    [
        ("L0_mm", 49.0, 0.049),
        ("R0_mm", 3.1, 0.0031),
        ("t0_mm", 0.65, 0.00065),
        ("alpha0_deg", 70.5, np.radians(70.5)),
    ],
)
def test_a_sampled_dimension_is_that_of_a_muscle_declared_so(name: str, value: float, si: float) -> None:
    sampled = made_with(Sensors(), GeometrySd(**{name: 0.3}))
    other = made_with(Sensors(), GeometrySd(), **{name: value})
    assert name in sampled.names and name not in other.names
    assert bare_force(sampled, {name: si}) == pytest.approx(bare_force(other, {}), rel=1e-6)
    assert bare_force(sampled, {}) != pytest.approx(bare_force(other, {}), rel=1e-3)


def test_a_gauge_s_offset_is_the_true_pressure_less_its_reading() -> None:
    """And no pressure is below none; where the muscle was seen to pull there was some."""
    made = made_with(Sensors(pressure_bias_sd_kPa=5.0), GeometrySd())
    assert made.setting is not None and made.setting.pulls_at == pytest.approx(100e3)
    plain = made_with(Sensors(), GeometrySd())
    assert bare_force(made, {BIAS: 8e3}) == pytest.approx(bare_force(plain, {}, 158.0), rel=1e-9)
    assert bare_force(made, {BIAS: -8e3}, 5.0) == pytest.approx(0.0, abs=1e-12)
    (prior,) = (p.prior for p in nuisance_parameters(made.setting))
    assert prior == NormalWithin(0.0, 5e3, -made.setting.pulls_at, np.inf)


def test_what_an_effect_holds_is_sampled_once() -> None:
    """A dead-band and a gauge's offset, or a braid's angle and its error, are one in every recording."""
    told = Sensors(pressure_bias_sd_kPa=5.0), GeometrySd(alpha0_deg=1.0)
    assert {BIAS, "alpha0_deg"} <= set(made_with(*told).names)
    names = made_with(*told, effects=("dead_band", "braid_angle")).names
    assert not {BIAS, "alpha0_deg"} & set(names)
    assert {"P_DB_kPa", "delta_alpha_deg"} <= set(names)


@pytest.mark.parametrize("declared", [0.1, 1.0])
def test_an_angle_that_is_wrong_has_the_declared_sd_as_its_prior(declared: float) -> None:
    """With tails: eight of its sds are not out of reach (of a normal one 32 nats, here 14)."""
    made = made_with(Sensors(), GeometrySd(alpha0_deg=declared), effects=("braid_angle",))
    (prior,) = (p.prior for p in made.parameters if p.name == "delta_alpha_deg")
    assert prior.sd == pytest.approx(np.radians(declared), rel=1e-6)
    assert 0.5 * prior.to_normal(8.0 * np.radians(np.array([declared])))[0] ** 2 < 16.0
