"""Length offset: the crosshead's zero is not the muscle's rest length."""

from __future__ import annotations

from dataclasses import replace

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("offset_mm", LongTailed(0.02 * setting.geometry.L0), "true shortening minus the reading"),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    return replace(state, displacement=state.displacement + values["offset_mm"])


register(
    Effect(
        id="length_offset",
        stage=Stage.RIG,
        title="Length offset",
        sentence="the crosshead was zeroed at another length than the muscle's rest length",
        told_by="the crosshead's reading where the unpressurised muscle just goes taut",
        source="true shortening = reading + offset",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        bends={"contraction": 1, "settling": 3},
    )
)
