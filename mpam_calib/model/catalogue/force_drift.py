"""Force drift: the load cell's zero wanders over the test."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.bend import EARLY
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.units import MINUTE


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    # 2 % of the force scale over the test, or over ten minutes of a longer one.
    sd = 0.02 * setting.force_scale / float(np.clip(setting.duration, MINUTE, 10.0 * MINUTE))
    return (Parameter("drift_N_per_min", LongTailed(sd), "wander of the load cell's zero"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return replace(state, zero=state.zero + values["drift_N_per_min"] * state.readings.time)


def _settling(state: State, values: Values, setting: Setting) -> State:
    """Most of it early in the test, as a load cell warms up."""
    span = max(setting.duration, 1.0)
    path = span * np.log1p(EARLY * state.readings.time / span) / np.log1p(EARLY)
    return replace(state, zero=state.zero + values["drift_N_per_min"] * path)


def _tared(state: State, values: Values, setting: Setting) -> State:
    """Anew in each file with a clock of its own: the cell was tared before."""
    return replace(state, zero=state.zero + values["drift_N_per_min"] * state.readings.file_time)


register(
    Effect(
        id="force_drift",
        stage=Stage.SENSOR,
        title="Force drift",
        sentence="the load cell's zero wanders while the test runs",
        told_by="the load cell's reading without a muscle before, during and after the test",
        source="linear in time over the whole test",
        parameters=_parameters,
        apply=_apply,
        forms={"settling": _settling, "tared": _tared},
        kinds={
            "settling": "most of it early in the test",
            "tared": "here anew in each file, as if tared before",
        },
        bends={"time": 5},
        looseness=4.0,
        added=True,
    )
)
