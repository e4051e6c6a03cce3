"""Stress softening (Mullins): the first cycles are stiffer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.model.curves import level_stroke
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Parameter
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]
Apply = Callable[[State, Values, Setting], State]

FADING = ("virgin-fading", "force-fading")
POWERS = ("power", "force-power", "test-power", "test-force-power")


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("first_cycle_fraction", LongTailed(0.2), "how much stiffer the first cycle is", "", ""),
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


def _by_power(whole: bool, over_test: bool) -> Apply:
    """The excess as a power of the cycle: slow, or all but the first cycle's alone."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        cycle = state.readings.test_cycle if over_test else state.readings.cycle
        fading = cycle ** -np.minimum(values["cycle_exponent"], 20.0)
        gain = 1.0 + values["first_cycle_fraction"] * fading
        if whole:
            return replace(state, gain=state.gain * gain)
        return replace(state, wall_gain=state.wall_gain * gain)

    return apply


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("cycle_exponent", LogNormal(0.8, 0.6), "power of the cycle count", "textbook", ""),)


def _level_way(state: State, setting: Setting) -> Array:
    """Way (m) to the level's longest stroke; none on its first, which stretches the bladder anew."""
    new = (state.readings.cycle < 1.5) & (state.readings.sign < 0.0)
    way = np.maximum(level_stroke(state, setting) - state.readings.displacement, 0.0)
    return np.where(new, 0.0, way)


def _virgin(whole: bool, fades: bool, over_test: bool = False) -> Apply:
    """As new where it had never been stretched so far; from then on the softer, the farther from there."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        way = state.readings.behind if over_test else _level_way(state, setting)
        share = special.erfc(way / setting.stroke / values["softening_reach"])
        if fades:
            share = share * state.readings.cycle ** -np.minimum(values["cycle_exponent"], 20.0)
        gain = 1.0 + values["first_cycle_fraction"] * share
        if whole:
            return replace(state, gain=state.gain * gain)
        return replace(state, wall_gain=state.wall_gain * gain)

    return apply


def _reach_and_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (*_reach(setting), *_exponent(setting))


def _reach(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "softening_reach", LogNormal(0.3, 0.5), "share of the stroke over which it softens", "", ""
        ),
    )


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
        forms={
            "force": _force,
            "test": _test,
            "test-force": _test_force,
            "power": _by_power(whole=False, over_test=False),
            "force-power": _by_power(whole=True, over_test=False),
            "test-power": _by_power(whole=False, over_test=True),
            "test-force-power": _by_power(whole=True, over_test=True),
            "virgin": _virgin(whole=False, fades=False),
            "virgin-fading": _virgin(whole=False, fades=True),
            "force-fading": _virgin(whole=True, fades=True),
            "test-virgin": _virgin(whole=False, fades=False, over_test=True),
        },
        own=dict.fromkeys(POWERS, _exponent)
        | dict.fromkeys(("virgin", "test-virgin"), _reach)
        | dict.fromkeys(FADING, _reach_and_exponent),
        apart=("virgin-fading",),
        sources=dict.fromkeys(POWERS, "textbook: power of the cycle count (steep: the first cycle alone)")
        | dict.fromkeys(
            ("virgin", "test-virgin", *FADING),
            "Ogden & Roxburgh 1999, with the distance to the longest stroke in place of energies",
        ),
        kinds={
            "force": "here the whole muscle, not the bladder alone",
            "test": "here in the first cycles of the whole test, not of each level",
            "test-force": "here the whole muscle, in the first cycles of the whole test, not of each level",
        },
        bends={"cycle": 2, "cycles": 1, "contraction": 1, "branch": 1},
        looseness=3.0,
    )
)
