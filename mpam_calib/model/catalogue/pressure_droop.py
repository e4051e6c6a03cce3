"""Pressure droop: at full stroke the muscle's pressure is below the reading at the regulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfNormal, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("droop_percent", HalfNormal(0.05), "pressure missing at full stroke"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    part = state.displacement / setting.stroke
    return replace(state, pressure=state.pressure * (1.0 - values["droop_percent"] * part))


def _level(state: State, values: Values, setting: Setting) -> State:
    """In proportion to each level's own stroke."""
    if setting.strokes is None:
        return _apply(state, values, setting)
    strokes = np.where(setting.strokes > 0.0, setting.strokes, setting.stroke)
    part = state.displacement / np.interp(state.readings.pressure, setting.levels, strokes)
    return replace(state, pressure=state.pressure * (1.0 - values["droop_percent"] * part))


register(
    Effect(
        id="pressure_droop",
        stage=Stage.RIG,
        title="Pressure droop",
        sentence="the supply does not hold the pressure: at full stroke the muscle sees less than the gauge",
        told_by="a pressure sensor at the muscle itself, or the same loop at a tenth of the speed",
        source="first order in the stroke: P(1 − droop·x/stroke)",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={"level": _level},
        kinds={"level": "here full stroke is each level's own"},
        bends={"contraction": 3, "speed": 1},
        looseness=2.0,
    )
)
