"""Tip shape: the rounded ends take working length (thesis Eq. 2.46-2.47)."""

from __future__ import annotations

import numpy as np

from mpam_calib.model.curves import middle_pressure, middle_shape, signed_power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import (
    SHAPES,
    SHORTEST,
    tip_shortened_length,
    tip_shortened_length_of_its_own,
)
from mpam_calib.physics.statics import work_lost_at_tips


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    # The minus sign of Eq. 2.47 is empirical, so the factor may take either.
    return (
        Parameter(
            "tip_factor",
            Normal(0.0, 1.0),
            "how far the rounded tips shorten the muscle (theory: 1)",
            "thesis Eq. 2.47",
            "",
        ),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    R = SHAPES[state.kinematics](state.length, state.rest).R
    return state._replace(length=tip_shortened_length(state.length, R, state.rest, values["tip_factor"]))


def _working(state: State, values: Values, setting: Setting) -> State:
    """The radius that rounds the tips is that of the working length itself."""
    length = tip_shortened_length_of_its_own(state.length, state.kinematics, state.rest, values["tip_factor"])
    return state._replace(length=length)


def _power(state: State, values: Values, setting: Setting) -> State:
    """A power of the radius's growth: its square for a flat arc, near none for ends that are lost at once."""
    middle = np.maximum(middle_shape(state, setting).R - state.rest.R0, 1e-3 * state.rest.R0)
    growth = (SHAPES[state.kinematics](state.length, state.rest).R - state.rest.R0) / middle
    R = state.rest.R0 + middle * signed_power(growth, values["tip_exponent"])
    return state._replace(length=tip_shortened_length(state.length, R, state.rest, values["tip_factor"]))


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("tip_exponent", LogNormal(1.0, 0.4), "power of the radius's growth", "textbook", ""),)


def _round(state: State, values: Values, setting: Setting) -> State:
    """The ends are caps of the whole radius: the lost length goes with R, not with its growth."""
    middle = middle_shape(state, setting).R
    share = (middle - state.rest.R0) / middle
    R = state.rest.R0 + share * SHAPES[state.kinematics](state.length, state.rest).R
    return state._replace(length=tip_shortened_length(state.length, R, state.rest, values["tip_factor"]))


def _tapered(state: State, values: Values, setting: Setting) -> State:
    """The ends take the same share of every contraction: Eq. 2.47's length at half of the stroke."""
    half = 0.5 * setting.stroke
    lost = 2.0 * (np.pi / 2.0 - 1.0) * (middle_shape(state, setting).R - state.rest.R0) / half
    return state._replace(length=state.length - values["tip_factor"] * lost * (state.rest.L0 - state.length))


def _easing(state: State, values: Values, setting: Setting) -> State:
    """Tapered ends, less as the pressure rises, k = b + a·e^(−P/p); as above at the middle pressure."""
    past = (state.pressure - middle_pressure(setting)) / values["easing_kPa"]
    share = values["tip_eased_share"]
    part = 1.0 - share + share * np.exp(np.clip(-past, -3.0, 3.0))
    return _tapered(state, {"tip_factor": values["tip_factor"] * part}, setting)


def _eased(setting: Setting) -> tuple[Parameter, ...]:
    pressure = Parameter(
        "easing_kPa", LogNormal(0.5 * setting.top_pressure, 0.7), "pressure that eases the ends"
    )
    return (Parameter("tip_eased_share", Normal(0.5, 0.5), "share that pressure eases", "", ""), pressure)


def _volume(state: State, values: Values, setting: Setting) -> State:
    """The muscle keeps its length, and the gas does no work on what its ends lack of the cylinder."""
    shape = SHAPES[state.kinematics](np.maximum(state.length, SHORTEST * state.rest.L0), state.rest)
    loss = work_lost_at_tips(state.pressure, shape, state.rest)
    return state._replace(lost=state.lost + values["tip_factor"] * loss)


register(
    Effect(
        id="tip_shape",
        stage=Stage.SHAPE,
        title="Tip shape",
        sentence="the ends are rounded: the working length is shorter than the muscle",
        told_by="a second muscle of twice the length, or a photograph of the contracted ends",
        resolution={"tip_factor": 0.1},
        source="thesis Eq. 2.46-2.47",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={
            "working": _working,
            "power": _power,
            "round": _round,
            "tapered": _tapered,
            "easing": _easing,
            "volume": _volume,
        },
        own={"power": _exponent, "easing": _eased},
        sources={
            "working": "thesis Eq. 2.47 with the radius at L′ in place of that at L",
            "power": "textbook: sagitta of an arc over a fixed end, (R − R0)²; a cone of fixed slope, R − R0",
            "tapered": "conical ends: contraction times k (Tondu and Lopez 2000, doi:10.1109/37.833638)",
            "easing": "conical ends, contraction times k = a·e^(−P) + b (Tondu and Lopez 2000)",
            "volume": "textbook: virtual work −P dV/dL of a cylinder with conical ends",
            "round": "textbook: hemispherical or elliptical end caps, a length in proportion to R",
        },
        bends={"contraction": 4},
        looseness=2.0,
    )
)
