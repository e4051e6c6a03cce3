"""Tip shape: the rounded ends take working length (thesis Eq. 2.46-2.47)."""

from __future__ import annotations

from dataclasses import replace

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHAPES, tip_shortened_length


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    # The minus sign of Eq. 2.47 is empirical, so the factor may take either.
    return (
        Parameter("tip_factor", Normal(0.0, 1.0), "share of Eq. 2.47's shortening", "thesis Eq. 2.47", ""),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    R = SHAPES[state.kinematics](state.length, state.rest).R
    return replace(state, length=tip_shortened_length(state.length, R, state.rest, values["tip_factor"]))


register(
    Effect(
        id="tip_shape",
        stage=Stage.SHAPE,
        title="Tip shape",
        sentence="the ends are rounded: the working length is shorter than the muscle",
        told_by="a second muscle of twice the length, or a photograph of the contracted ends",
        source="thesis Eq. 2.46-2.47",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        bends={"contraction": 4},
        looseness=2.0,
    )
)
