"""Creep: at a pressure level the force relaxes with time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State

ONSET = 1.0
"""Seconds after which relaxation is counted."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("creep_per_decade", LongTailed(0.05), "share of the force lost per decade", "", "1/decade"),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    decades = np.log10(1.0 + state.readings.time_at_level / ONSET)
    return replace(state, gain=state.gain * (1.0 - values["creep_per_decade"] * decades))


def _wall(state: State, values: Values, setting: Setting) -> State:
    """The bladder's stress relaxes; the gas and the braid do not."""
    decades = np.log10(1.0 + state.readings.time_at_level / ONSET)
    return replace(state, wall_gain=state.wall_gain * (1.0 - values["creep_per_decade"] * decades))


register(
    Effect(
        id="creep",
        stage=Stage.HISTORY,
        title="Creep",
        sentence="the force relaxes with the logarithm of the time spent at a pressure",
        told_by="a hold of ten minutes at one pressure and length",
        source="logarithmic relaxation: F(1 − creep·log10(1 + t/1 s))",
        parameters=_parameters,
        apply=_apply,
        forms={"wall": _wall},
        kinds={"wall": "here the bladder's alone"},
        bends={"level_time": 4},
        looseness=1.5,
    )
)
