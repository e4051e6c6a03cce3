"""Creep: at a pressure level the force relaxes with time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import box_cox, settled
from mpam_calib.model.effect import Apply, Effect, Parameters, Share, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.readings import TIMES
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]

ONSET = 1.0
"""Seconds after which relaxation is counted."""
NARROWEST = 0.25
"""Decades by which any relaxation's times are spread: half of what lies between two of TIMES."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "creep_per_decade",
            LongTailed(0.05),
            "relaxation of the force for ten times the time",
            "",
            "1/decade",
        ),
    )


def _middle(setting: Setting) -> float:
    """Half the longest time at a level, s: there all equations agree."""
    return max(0.5 * setting.level_time, ONSET)


def _log(state: State, values: Values, setting: Setting) -> Array:
    """Decades from a level's first reading on."""
    return np.log10(1.0 + state.readings.time_at_level / ONSET)


def _since(state: State, values: Values) -> Array:
    """Time since the level was reached, some of it before the first reading, s."""
    return state.readings.time_at_level + values["creep_before_s"]


def _before(setting: Setting) -> Parameter:
    return Parameter("creep_before_s", LogNormal(2.0, 1.0), "time at the level before its first reading")


def _early(state: State, values: Values, setting: Setting) -> Array:
    """Decades since the level was reached: some are over when the first reading is taken."""
    return np.asarray(np.log10(1.0 + _since(state, values) / ONSET))


def _power(state: State, values: Values, setting: Setting) -> Array:
    """Decades along a power of that time instead of its logarithm; below 0 it comes to an end."""
    middle, exponent = 1.0 + _middle(setting) / ONSET, values["creep_exponent"]
    part = box_cox(1.0 + _since(state, values) / ONSET, exponent) / box_cox(np.array(middle), exponent)
    return np.asarray(np.log10(middle) * part)


def _exponent(setting: Setting) -> Parameter:
    return Parameter("creep_exponent", Normal(0.0, 0.3), "power of time", "textbook", "")


def _solid(state: State, values: Values, setting: Setting) -> Array:
    """Decades along an exponential with one time constant: a spring beside a spring and a dashpot."""
    part = settled(_since(state, values), values["relaxation_s"], _middle(setting))
    return np.asarray(np.log10(1.0 + _middle(setting) / ONSET) * part)


def _stretched(state: State, values: Values, setting: Setting) -> Array:
    """Decades along an exponential of a power of time: relaxations with many time constants."""
    power = np.minimum(values["creep_stretch"], 3.0)
    part, middle = (
        -np.expm1(-((time / values["relaxation_s"]) ** power))
        for time in (state.readings.time_at_level, _middle(setting))
    )
    return np.asarray(np.log10(1.0 + _middle(setting) / ONSET) * part / middle)


def _steps(state: State, values: Values, setting: Setting) -> Array:
    """Decades along relaxations that every step of pressure sets off, carried on from level to level.

    Their time constants lie about one, normally over the logarithm of time; a step is made some time before
    its level's first reading.
    """
    away = np.log10(TIMES / values["relaxation_s"]) ** 2 / (values["relaxation_decades"] ** 2 + NARROWEST**2)
    weight = np.exp(-0.5 * (away - away.min(axis=-1, keepdims=True)))
    middle = weight @ -np.expm1(-_middle(setting) / TIMES)[:, None]
    fades = np.exp(-values["creep_before_s"] / TIMES)
    left = weight.sum(axis=-1, keepdims=True) - (weight * fades) @ (1.0 - state.readings.relaxed).T
    part = left / middle
    return np.asarray(np.log10(1.0 + _middle(setting) / ONSET) * part)


def _decades(setting: Setting) -> Parameter:
    return Parameter("relaxation_decades", LogNormal(0.6, 0.5), "spread of the times of relaxation", "", "")


def _stretch(setting: Setting) -> Parameter:
    return Parameter("creep_stretch", LogNormal(0.6, 0.4), "power of the time in the exponential", "", "")


def _time(setting: Setting) -> Parameter:
    return Parameter("relaxation_s", LogNormal(0.4 * _middle(setting), 1.0), "time of relaxation")


def _whole(decades: Share) -> Apply:
    """The whole force relaxes along such decades."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        gain = 1.0 - values["creep_per_decade"] * decades(state, values, setting)
        return state._replace(gain=state.gain * gain)

    return apply


def _bladder(decades: Share) -> Apply:
    """The bladder's stress alone relaxes along them."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        gain = 1.0 - values["creep_per_decade"] * decades(state, values, setting)
        return state._replace(wall_gain=state.wall_gain * gain)

    return apply


DECADES = {"early": _early, "power": _power, "solid": _solid, "stretched": _stretched, "steps": _steps}
OWN: dict[str, Parameters] = {
    "early": lambda setting: (_before(setting),),
    "power": lambda setting: (_exponent(setting), _before(setting)),
    "solid": lambda setting: (_time(setting), _before(setting)),
    "stretched": lambda setting: (_time(setting), _stretch(setting)),
    "steps": lambda setting: (_time(setting), _decades(setting), _before(setting)),
}
SOURCES = {
    "early": "the same logarithm, counted from before the first reading",
    "power": "power law of relaxation (Nutting 1921; Findley 1944)",
    "solid": "standard linear solid (Zener 1948): 1 − exp(−t/τ)",
    "stretched": "stretched exponential, 1 − exp(−(t/τ)^β) (Kohlrausch 1854; Williams & Watts 1970)",
    "steps": "superposition of what every step of pressure sets off (Boltzmann 1874), Wiechert's solid",
}
"""Equations for the relaxation, of the whole force or of the bladder alone."""

register(
    Effect(
        id="creep",
        stage=Stage.HISTORY,
        title="Creep",
        sentence="the force relaxes with the time spent at a pressure",
        told_by="a hold of ten minutes at one pressure and length",
        source="logarithmic relaxation: F(1 − creep·log10(1 + t/1 s))",
        parameters=_parameters,
        apply=_whole(_log),
        forms={
            "wall": _bladder(_log),
            **{form: _whole(decades) for form, decades in DECADES.items()},
            **{f"wall-{form}": _bladder(decades) for form, decades in DECADES.items()},
        },
        own={f"{kind}{form}": own for kind in ("", "wall-") for form, own in OWN.items()},
        sources={f"{kind}{form}": source for kind in ("", "wall-") for form, source in SOURCES.items()},
        apart=("steps",),
        kinds={"wall": "here the bladder's alone"},
        bends={"level_time": 4},
        looseness=1.5,
    )
)
