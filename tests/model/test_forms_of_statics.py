"""Forms of the statics' effects: the wall's share, what the strands store, what a fit leaves."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from mpam_calib.model.effect import effect
from mpam_calib.physics.kinematics import SHAPES
from mpam_calib.physics.statics import axial_lever, hoop_lever, strains

from .forms import (
    MIDDLE,
    applied,
    before_and_after,
    force,
    middle,
    one,
    proportional,
    rows,
    rubbing,
    setting_for,
    shaped,
    start,
    without,
)


@pytest.mark.parametrize(
    ("form", "own", "harder"),
    [
        ("fung", {"hardening": 0.8}, lambda e: np.exp(0.8 * e)),
        ("gent", {"limit_strain": 1.5}, lambda e: 1.0 / (1.0 - (e / 1.5) ** 2)),
    ],
)
def test_a_missing_term_hardens_in_both_directions(form: str, own: dict[str, float], harder: Any) -> None:
    setting = setting_for(f"order_too_low:{form}")
    state = shaped(setting)
    assert state.shape is not None
    after = applied(f"order_too_low:{form}", state, setting, next_order=0.1, **own)
    z, x = strains(state.shape, state.rest, "engineering")
    stress = axial_lever(state.shape) * z**3 * harder(z) - hoop_lever(state.shape) * x**3 * harder(x)
    proportional(state.lost - after.lost, stress)
    assert np.sign(state.lost - after.lost)[0, -1] == np.sign(stress)[0, -1]


def test_a_wall_s_share_goes_with_its_thickness_over_its_radius() -> None:
    setting = setting_for("wall_pressure:thick")
    state, half = shaped(setting), shaped(setting, middle(setting))
    own = {"wall_factor": 0.4, "thickness_exponent": 1.3}
    assert state.shape is not None
    share = 1.0 - applied("wall_pressure:thick", state, setting, **own).wall_factor
    proportional(share, (state.shape.t / state.shape.R) ** 1.3)
    assert 1.0 - applied("wall_pressure:thick", half, setting, **own).wall_factor == pytest.approx(0.4)


def test_a_wall_s_share_may_go_with_the_pressure() -> None:
    form = "wall_pressure:pressed"
    before, after = before_and_after(form, wall_factor=0.4, wall_exponent=0.7)
    missing = 1.0 - after.wall_factor
    ratio = before.pressure / before.pressure[..., :1]
    np.testing.assert_allclose(missing, missing[..., :1] * ratio**0.7, rtol=1e-12)


def test_a_wall_s_share_may_settle_as_it_seats() -> None:
    before, after = before_and_after("wall_pressure:seated", wall_factor=0.4, seating_kPa=6e4)
    missing = np.ravel(1.0 - after.wall_factor)
    pressure = np.ravel(before.pressure)
    share = 1.0 - np.exp(-pressure / 6e4)
    np.testing.assert_allclose(missing / missing[0], share / share[0], rtol=1e-12)


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


def test_strands_may_store_and_rub_by_another_power_of_the_pressure() -> None:
    setting = setting_for("braid_stretch:power")
    state = shaped(setting)
    plain = applied("braid_stretch", state, setting, braid_factor=1.3).lost
    lost = applied("braid_stretch:power", state, setting, braid_factor=1.3, braid_exponent=1.4).lost
    np.testing.assert_allclose(lost / plain, (state.pressure / MIDDLE) ** (1.4 - 2.0), rtol=1e-9)
    for pressure in setting.levels:
        own = rubbing("strand_friction:power", 0.5, pressure, f_s=0.3, strand_exponent=1.0)
        expected = (pressure / MIDDLE) ** (1.0 - 4.0 / 3.0) * rubbing(
            "strand_friction", 0.5, pressure, f_s=0.3
        )
        assert own == pytest.approx(expected, rel=1e-9)


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
