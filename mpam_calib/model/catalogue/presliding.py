"""Presliding: after a reversal the friction turns over gradually."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.02 * setting.stroke, 1.0)
    return (Parameter("reversal_mm", prior, "travel over which friction turns over"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    # Every stroke begins with a turn: before a level's first one the muscle was pressurised, and moved.
    readings = state.readings
    turned = 1.0 - 2.0 * np.exp(-readings.travel / values["reversal_mm"])
    return replace(state, sign=state.sign * turned)


def _from_rest(state: State, values: Values, setting: Setting) -> State:
    """A level's first stroke starts without friction, not against it."""
    readings = state.readings
    turned = 1.0 - (1.0 + readings.reversal) * np.exp(-readings.travel / values["reversal_mm"])
    return replace(state, sign=state.sign * turned)


register(
    Effect(
        id="presliding",
        stage=Stage.FRICTION,
        title="Presliding",
        sentence="after each turn the friction builds up over some travel instead of at once",
        told_by="small reversals in the middle of the stroke",
        source="Dahl's model at constant load: s(1 − 2 exp(−travel/reversal))",
        parameters=_parameters,
        apply=_apply,
        forms={"rest": _from_rest},
        kinds=("rest",),
        bends={"travel": 3},
        looseness=2.0,
    )
)
