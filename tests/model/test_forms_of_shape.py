"""Forms of the shape's effects against geometry that is reckoned by itself."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mpam_calib.model.effect import effect
from mpam_calib.physics.kinematics import SHAPES, radius_inextensible_braid

from .forms import applied, middle, one, proportional, rows, setting_for, shaped, start

Array = np.ndarray
ARC = np.pi - 2.0
"""Length that Eq. 2.47 takes for each metre by which the radius grows."""


@pytest.mark.parametrize(
    ("form", "own", "shape"),
    [
        ("", {}, lambda R, R0, x: R - R0),
        (":power", {"tip_exponent": 2.0}, lambda R, R0, x: np.sign(R - R0) * (R - R0) ** 2),
        (":round", {}, lambda R, R0, x: R),
        (":tapered", {}, lambda R, R0, x: x),
    ],
)
def test_tips_take_a_length_by_their_shape(form: str, own: dict[str, float], shape: Any) -> None:
    """At half the stroke all take what Eq. 2.47 does."""
    setting = setting_for("tip_shape")
    state, half = shaped(setting), shaped(setting, middle(setting))
    own = {"tip_factor": 0.8, **own}
    R = radius_inextensible_braid(state.length, state.rest)
    lost = state.length - applied(f"tip_shape{form}", state, setting, **own).length
    proportional(lost, shape(R, state.rest.R0, state.displacement))
    there = half.length - applied(f"tip_shape{form}", half, setting, **own).length
    growth = radius_inextensible_braid(half.length, half.rest) - half.rest.R0
    np.testing.assert_allclose(there, 0.8 * ARC * growth, rtol=1e-9)


def test_tips_by_the_working_length_solve_its_equation() -> None:
    setting = setting_for("tip_shape:working")
    state = shaped(setting)
    length = applied("tip_shape:working", state, setting, tip_factor=0.8).length
    growth = radius_inextensible_braid(length, state.rest) - state.rest.R0
    np.testing.assert_allclose(length + 0.8 * ARC * growth, state.length, rtol=1e-9)


def test_what_conical_ends_lack_of_the_cylinder_does_no_work() -> None:
    """−P dV/dL of the volume outside two cones of 45° from R0 to R, by differences."""
    setting = setting_for("tip_shape:volume")
    state = shaped(setting)
    after = applied("tip_shape:volume", state, setting, tip_factor=0.8)

    def lacks(length: Array) -> Array:
        R = radius_inextensible_braid(length, state.rest)
        cone = np.pi / 3.0 * (R - state.rest.R0) * (R**2 + R * state.rest.R0 + state.rest.R0**2)
        return 2.0 * (np.pi * R**2 * (R - state.rest.R0) - cone)

    step = 1e-6 * state.rest.L0
    slope = (lacks(state.length + step) - lacks(state.length - step)) / (2.0 * step)
    np.testing.assert_allclose(after.lost, -0.8 * state.pressure * slope, rtol=1e-5, atol=1e-6)
    np.testing.assert_array_equal(after.length, state.length)


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
