"""Frictions in the chain: one that changes another comes after it, and short muscles rub finitely."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpam_calib.model.chain import Chain
from mpam_calib.model.friction import DeclaredFriction
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.readings import Readings
from mpam_calib.specimen.declaration import Geometry

from . import build

N = 8


def model(**simulation: object) -> Model:
    geometry = simulation.pop("geometry", build.GEOMETRY)
    declared = {"law": "linear", "order": 2, "friction": "none", **simulation}
    return build_model(build.blueprint(declared, build.PLAIN, geometry=geometry))


def moving(made: Model, sign: float, stroke: float) -> Readings:
    """Readings at four times the test's mean speed."""
    assert made.setting is not None
    x = np.linspace(0.0, stroke, N)
    plain = Readings.at_rest(np.full(N, 1.5e5), x, np.full(N, sign))
    fast = np.full(N, 4.0 * made.setting.speed)
    return replace(plain, speed=fast, pace=fast, level=np.ones(N, dtype=np.int64), time=np.arange(N) / 10.0)


def friction(made: Model, stroke: float = 0.008, **changed: float) -> np.ndarray:
    """Half of what loading and unloading differ by, N, at typical parameters but those that are given."""
    assert made.chain is not None
    values = made.values(np.zeros((1, len(made.names))))
    values |= {name: np.full((1, 1), value) for name, value in changed.items()}
    eta = np.zeros((1, made.linear_sizes[0]))
    up, down = (made.chain.force(values, eta, moving(made, sign, stroke))[0] for sign in (1.0, -1.0))
    return np.asarray(0.5 * (up - down))


@pytest.mark.parametrize("form", ["viscous", "drag", "stroke-drag"])
def test_speed_adds_to_a_friction_that_is_an_effect_itself(form: str) -> None:
    """Its size is a share of the friction there is: nothing, where that came only after it."""
    made = model(effects=(f"rate_friction:{form}", "strand_friction"))
    still = friction(made, f_s=0.3, rate_per_decade=0.0)
    fast = friction(made, f_s=0.3, rate_per_decade=0.3)
    assert np.all(fast > 1.05 * still)


def test_the_order_of_declaration_does_not_count() -> None:
    names = ("rate_friction:viscous", "strand_friction")
    both = [friction(model(effects=e), f_s=0.3, rate_per_decade=0.3) for e in (names, names[::-1])]
    assert np.array_equal(*both)


@pytest.mark.parametrize("simulation", [{"friction": "strand"}, {"effects": ("strand_friction",)}])
def test_strands_rub_finitely_where_tips_take_the_whole_length(simulation: dict[str, Any]) -> None:
    short = Geometry(L0_mm=20.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=72.0)
    effects = (*simulation.get("effects", ()), "tip_shape")
    made = model(**{**simulation, "effects": effects, "geometry": short})
    found = friction(made, stroke=0.012, f_s=0.3, tip_factor=2.0)
    assert np.all(np.isfinite(found)) and np.all(found > 0.0)


def test_friction_of_each_level_is_its_own_and_between_them_interpolated() -> None:
    """At a level by its number, whatever the gauge reads there; beyond all of them the outer one's."""
    setting = model(friction="coulomb", friction_by_pressure=True).setting
    assert setting is not None
    friction = DeclaredFriction(setting)
    assert friction.names == ["K_f@100", "K_f@150", "K_f@200"]
    pressure = 1e3 * np.array([104.0, 104.0, 175.0, 50.0, 260.0])
    plain = Readings.at_rest(pressure, np.full(5, 0.004), np.ones(5))
    state = Chain(setting, None, False).start(
        replace(plain, level=np.array([0, -1, -1, -1, -1])), np.zeros(1)
    )
    values = dict(zip(friction.names, (np.full((1, 1), K) for K in (0.1, 0.2, 0.4)), strict=True))
    found = friction.apply(state, values).coulomb
    np.testing.assert_allclose(found, [[0.1, 0.108, 0.3, 0.1, 0.4]])


def test_a_level_s_friction_as_its_neighbours_say() -> None:
    """Between two levels along a straight line, beyond them as at the nearest."""
    made = model(friction="coulomb", friction_by_pressure=True)
    assert made.chain is not None and made.setting is not None
    declared = made.chain.friction
    levels = made.setting.levels
    values = {name: np.full((2, 1), 0.02 * (i + 1) ** 2) for i, name in enumerate(declared.names)}
    factors = 0.02 * (np.arange(len(levels)) + 1.0) ** 2
    for level, name in enumerate(declared.names):
        said = declared.as_others_say(values, level)
        others = np.arange(len(levels)) != level
        expected = np.interp(levels[level], levels[others], factors[others])
        assert said[name] == pytest.approx(np.full((2, 1), expected))
        assert all(said[n] is values[n] for n in declared.names if n != name)
    common = model(friction="coulomb").chain
    assert common is not None
    assert common.friction.as_others_say(values, 0) == values
