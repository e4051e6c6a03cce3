"""Rig compliance: grips, fixture and load cell give way in proportion to the force."""

from __future__ import annotations

from dataclasses import replace

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfNormal, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    # 2 % of the length at the force scale: a soft fixture, not a broken one.
    scale = 0.02 * setting.geometry.L0 / setting.force_scale
    return (
        Parameter("compliance_mm_per_N", HalfNormal(scale), "shortening that the fixture hides, per newton"),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    return replace(state, displacement=state.displacement + values["compliance_mm_per_N"] * state.guide)


register(
    Effect(
        id="rig_compliance",
        stage=Stage.RIG,
        title="Rig compliance",
        sentence="the fixture gives: under load the muscle is shorter than the crosshead says",
        told_by="a rigid bar in place of the muscle, loaded to the blocked force",
        source="true shortening = reading + compliance × force",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        uses_force=True,
        bends={"force": 2},
    )
)
