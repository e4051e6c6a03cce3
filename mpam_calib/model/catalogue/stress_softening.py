"""Stress softening (Mullins): the first cycles are stiffer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "first_cycle_fraction", LongTailed(0.2), "extra bladder stiffness in the first cycle", "", ""
        ),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    gain = 1.0 + values["first_cycle_fraction"] * np.exp(-(state.readings.cycle - 1.0))
    return replace(state, wall_gain=state.wall_gain * gain)


def _force(state: State, values: Values, setting: Setting) -> State:
    """The whole muscle is stiffer, not the bladder alone."""
    gain = 1.0 + values["first_cycle_fraction"] * np.exp(-(state.readings.cycle - 1.0))
    return replace(state, gain=state.gain * gain)


register(
    Effect(
        id="stress_softening",
        stage=Stage.HISTORY,
        title="Stress softening",
        sentence="the bladder is stiffer in its first cycles and softens with use (Mullins)",
        told_by="five more cycles at one level, and the first level again at the end",
        source="exponential in the cycle count: bladder stress × (1 + fraction·e^(1 − cycle))",
        parameters=_parameters,
        apply=_apply,
        forms={"force": _force},
        kinds=("force",),
        bends={"cycle": 2, "cycles": 1, "contraction": 1},
        looseness=3.0,
    )
)
