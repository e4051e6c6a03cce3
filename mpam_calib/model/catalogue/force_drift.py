"""Force drift: the load cell's zero wanders over the test."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.bend import EARLY
from mpam_calib.model.curves import half_test, settled, signed_power
from mpam_calib.model.effect import Apply, Effect, Share, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.units import MINUTE

Array = NDArray[np.float64]


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    # 2 % of the force scale over the test, or over ten minutes of a longer one.
    sd = 0.02 * setting.force_scale / float(np.clip(setting.duration, MINUTE, 10.0 * MINUTE))
    return (Parameter("drift_N_per_min", LongTailed(sd), "wander of the load cell's zero"),)


def _along(path: Share) -> Apply:
    """The zero wanders along a path: seconds of the plain line, (B or 1, n)."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        return state._replace(zero=state.zero + values["drift_N_per_min"] * path(state, values, setting))

    return apply


def _line(state: State, values: Values, setting: Setting) -> Array:
    return state.readings.time


def _settling(state: State, values: Values, setting: Setting) -> Array:
    """Most of it early in the test, as a load cell warms up."""
    span = max(setting.duration, 1.0)
    return np.asarray(span * np.log1p(EARLY * state.readings.time / span) / np.log1p(EARLY))


def _tared(state: State, values: Values, setting: Setting) -> Array:
    """Anew in each file with a clock of its own: the cell was tared before."""
    return state.readings.file_time


def _early(state: State, values: Values, setting: Setting) -> Array:
    """The same line from when the cell was tared: some of it is over when the first reading is taken."""
    return np.asarray(state.readings.time + values["tared_before_s"])


def _before(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(MINUTE, 1.0)
    return (Parameter("tared_before_s", prior, "time from the taring to the first reading"),)


def _power(state: State, values: Values, setting: Setting) -> Array:
    """A power of time, as far at half the test: 2 ever faster."""
    half = half_test(setting)
    return np.asarray(half * signed_power(state.readings.time / half, values["drift_exponent"]))


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("drift_exponent", LogNormal(1.0, 0.5), "power of time", "textbook", ""),)


def _root(state: State, values: Values, setting: Setting) -> Array:
    """The square root of time, as far at half the test: heat that is conducted into the cell."""
    half = half_test(setting)
    return np.asarray(np.sqrt(half * np.maximum(state.readings.time, 0.0)))


def _thermal(state: State, values: Values, setting: Setting) -> Array:
    """To a new balance of heat with one time constant, as far at half the test."""
    half = half_test(setting)
    return np.asarray(half * settled(state.readings.time, values["warming_s"], half))


def _time(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.6 * half_test(setting), 0.8)
    return (Parameter("warming_s", prior, "time in which the load cell warms up"),)


def _return(state: State, values: Values, setting: Setting) -> Array:
    """Out until half the test and back by its end: half a swing of the room's temperature."""
    half = half_test(setting)
    return np.asarray(half * np.sin(0.5 * np.pi * state.readings.time / half))


def _swing(state: State, values: Values, setting: Setting) -> Array:
    """With a period and a phase of its own, as large as the line at half the test."""
    turned = 2.0 * np.pi * state.readings.time / values["swing_s"] + values["swing_phase_deg"]
    return np.asarray(half_test(setting) * np.sin(turned))


def _period(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("swing_s", LogNormal(3.0 * half_test(setting), 0.6), "period of the swing"),
        Parameter("swing_phase_deg", Normal(0.0, 1.0), "phase of the swing when the test begins"),
    )


register(
    Effect(
        id="force_drift",
        stage=Stage.SENSOR,
        title="Force drift",
        sentence="the load cell's zero wanders while the test runs",
        told_by="the load cell's reading without a muscle before, during and after the test",
        source="linear in time over the whole test",
        parameters=_parameters,
        apply=_along(_line),
        of_test=True,
        forms={
            "settling": _along(_settling),
            "tared": _along(_tared),
            "early": _along(_early),
            "power": _along(_power),
            "root": _along(_root),
            "thermal": _along(_thermal),
            "return": _along(_return),
            "swing": _along(_swing),
        },
        own={"early": _before, "power": _exponent, "thermal": _time, "swing": _period},
        sources={
            "early": "the same line, from before the first reading",
            "power": "textbook: quadratic, or any other power",
            "root": "textbook: heat conducted into a thick body, square root of time",
            "thermal": "textbook: Newton's law of cooling, 1 − exp(−t/τ)",
            "return": "textbook: half a period of a sine over the test",
            "swing": "textbook: a sine, as the room's temperature swings",
        },
        kinds={
            "settling": "most of it early in the test",
            "tared": "here anew in each file, as if tared before",
        },
        bends={"time": 9},
        looseness=4.0,
        added=True,
    )
)
