"""Braid stretch: the strands store energy (thesis Eq. 2.25)."""

from __future__ import annotations

from dataclasses import replace

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfNormal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.statics import braid_energy_force


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("braid_factor", HalfNormal(2.0), "multiple of Eq. 2.25", "thesis Eq. 2.25", ""),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    braid = setting.braid
    assert braid is not None  # reading refuses this effect without [braid]
    loss = braid_energy_force(state.pressure, state.length, state.rest, braid.E_br, braid.R_br, braid.n)
    return replace(state, lost=state.lost + values["braid_factor"] * loss)


register(
    Effect(
        id="braid_stretch",
        stage=Stage.STATICS,
        title="Braid stretch",
        sentence="the strands stretch and store energy that the force then lacks",
        told_by="blocked force at the highest pressures with a stiffer sleeve",
        source="thesis Eq. 2.25-2.26",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        needs_braid=True,
        bends={"contraction": 1, "pressure": 2},
        looseness=2.0,
    )
)
