"""Creep: at a pressure level the force relaxes with time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import box_cox, settled
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]
Decades = Callable[[State, Values, Setting], Array]
Apply = Callable[[State, Values, Setting], State]

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


def _middle(setting: Setting) -> float:
    """Half the longest time at a level, s: there all equations agree."""
    return max(0.5 * setting.level_time, ONSET)


def _power(state: State, values: Values, setting: Setting) -> Array:
    """Decades along a power of time instead of its logarithm; below 0 it comes to an end."""
    middle, exponent = 1.0 + _middle(setting) / ONSET, values["creep_exponent"]
    part = box_cox(1.0 + state.readings.time_at_level / ONSET, exponent) / box_cox(np.array(middle), exponent)
    return np.asarray(np.log10(middle) * part)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("creep_exponent", Normal(0.0, 0.3), "power of time", "textbook", ""),)


def _solid(state: State, values: Values, setting: Setting) -> Array:
    """Decades along an exponential with one time constant: a spring beside a spring and a dashpot."""
    part = settled(state.readings.time_at_level, values["relaxation_s"], _middle(setting))
    return np.asarray(np.log10(1.0 + _middle(setting) / ONSET) * part)


def _time(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("relaxation_s", LogNormal(0.4 * _middle(setting), 1.0), "time of relaxation"),)


def _whole(decades: Decades) -> Apply:
    """The whole force relaxes along such decades."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        gain = 1.0 - values["creep_per_decade"] * decades(state, values, setting)
        return replace(state, gain=state.gain * gain)

    return apply


def _bladder(decades: Decades) -> Apply:
    """The bladder's stress alone relaxes along them."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        gain = 1.0 - values["creep_per_decade"] * decades(state, values, setting)
        return replace(state, wall_gain=state.wall_gain * gain)

    return apply


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
        forms={
            "wall": _wall,
            "power": _whole(_power),
            "solid": _whole(_solid),
            "wall-power": _bladder(_power),
            "wall-solid": _bladder(_solid),
        },
        own={"power": _exponent, "solid": _time, "wall-power": _exponent, "wall-solid": _time},
        sources=dict.fromkeys(("power", "wall-power"), "power law of relaxation (Nutting 1921; Findley 1944)")
        | dict.fromkeys(("solid", "wall-solid"), "standard linear solid (Zener 1948): 1 − exp(−t/τ)"),
        kinds={"wall": "here the bladder's alone"},
        bends={"level_time": 4},
        looseness=1.5,
    )
)
