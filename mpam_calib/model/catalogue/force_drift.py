"""Force drift: the load cell's zero wanders over the test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.units import MINUTE


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    sd = 0.02 * setting.force_scale / (10.0 * MINUTE)
    return (Parameter("drift_N_per_min", Normal(0.0, sd), "wander of the load cell's zero"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return replace(state, zero=state.zero + values["drift_N_per_min"] * state.readings.time)


def _settling(state: State, values: Values, setting: Setting) -> State:
    """A warm-up: the wander slows down, with a third of the test as its time constant."""
    time = state.readings.time
    constant = max(setting.duration, 1.0) / 3.0
    wander = values["drift_N_per_min"] * constant * -np.expm1(-time / constant)
    return replace(state, zero=state.zero + wander)


def _square(state: State, values: Values, setting: Setting) -> State:
    """A wander that speeds up, as fast as the linear one on average."""
    time = state.readings.time
    wander = values["drift_N_per_min"] * time**2 / max(setting.duration, 1.0)
    return replace(state, zero=state.zero + wander)


register(
    Effect(
        id="force_drift",
        stage=Stage.SENSOR,
        title="Force drift",
        sentence="the load cell's zero wanders while the test runs",
        source="linear in time over the whole test",
        parameters=_parameters,
        apply=_apply,
        forms={"settling": _settling, "square": _square},
        bends={"time": 2},
    )
)
