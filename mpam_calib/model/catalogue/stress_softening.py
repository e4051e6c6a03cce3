"""Stress softening (Mullins): the first cycles are stiffer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "first_cycle_fraction", LongTailed(0.2), "extra bladder stiffness in the first cycle", "", ""
        ),
    )


def _excess(values: Values, cycle: Array) -> Array:
    return np.asarray(values["first_cycle_fraction"] * np.exp(-(cycle - 1.0)))


def _apply(state: State, values: Values, setting: Setting) -> State:
    gain = 1.0 + _excess(values, state.readings.cycle)
    return replace(state, wall_gain=state.wall_gain * gain)


def _force(state: State, values: Values, setting: Setting) -> State:
    """The whole muscle is stiffer, not the bladder alone."""
    return replace(state, gain=state.gain * (1.0 + _excess(values, state.readings.cycle)))


def _test(state: State, values: Values, setting: Setting) -> State:
    """In the first cycles of the whole test: what has softened stays soft at the levels that follow."""
    gain = 1.0 + _excess(values, state.readings.test_cycle)
    return replace(state, wall_gain=state.wall_gain * gain)


def _test_force(state: State, values: Values, setting: Setting) -> State:
    """The whole muscle, in the first cycles of the whole test."""
    return replace(state, gain=state.gain * (1.0 + _excess(values, state.readings.test_cycle)))


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
        forms={"force": _force, "test": _test, "test-force": _test_force},
        kinds={
            "force": "here the whole muscle, not the bladder alone",
            "test": "here in the first cycles of the whole test, not of each level",
            "test-force": "here the whole muscle, in the first cycles of the whole test, not of each level",
        },
        bends={"cycle": 2, "cycles": 1, "contraction": 1, "branch": 1},
        looseness=3.0,
    )
)
