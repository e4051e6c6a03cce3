"""Presliding: after a reversal the friction turns over gradually."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import STEEPEST
from mpam_calib.model.distinct import over_distinct
from mpam_calib.model.effect import Apply, Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, Normal, Parameter
from mpam_calib.model.readings import FAR, Readings
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]

OWN = ("reversal_mm", "dahl_exponent", "wen_exponent", "reversal_exponent")
"""Parameters of its equations: the reversal, and the exponent that some of them have."""
DAHL = ("dahl", "rest-dahl", "once-dahl", "masing-dahl", "sliding-dahl")
WEN = ("wen", "rest-wen", "once-wen")


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.02 * setting.stroke, 1.0)
    return (Parameter("reversal_mm", prior, "travel in which friction turns over after a reversal"),)


def _exponential(travel: Array, reversal: Array, values: Values) -> Array:
    """What is left to turn over after some travel, from 1 to 0: Dahl's model."""
    return np.exp(-travel / values["reversal_mm"])


def _ramp(travel: Array, reversal: Array, values: Values) -> Array:
    """The same in proportion to the travel, to its end: elastic up to full sliding."""
    return np.maximum(1.0 - travel / values["reversal_mm"], 0.0)


def _dahl(travel: Array, reversal: Array, values: Values) -> Array:
    """Dahl's law with an exponent: 0 is the ramp, 1/2 Iwan's even slip, 1 the exponential, 2 a hyperbola."""
    beyond = values["dahl_exponent"] - 1.0
    beyond = np.where(np.abs(beyond) < SAME, SAME, beyond)
    turn = travel / values["reversal_mm"]
    left = np.log1p(np.maximum(beyond * turn, NONE_LEFT - 1.0)) / beyond
    return np.asarray(np.exp(-np.minimum(left, 700.0)))


def _bouc_wen(travel: Array, reversal: Array, values: Values) -> Array:
    """Bouc and Wen's law: even up to no friction, then slower by its power n (n = 1 and 2: exactly)."""
    return 0.5 * (1.0 - _built_up(travel / values["reversal_mm"] - 1.0, values))


def _bouc_wen_from_rest(travel: Array, reversal: Array, values: Values) -> Array:
    """The same, on a stroke that no reversal began from no friction on."""
    return 0.5 * (1.0 - _built_up(travel / values["reversal_mm"] - reversal, values))


def _built_up(beyond: Array, values: Values) -> Array:
    """Friction, as a share of the full, so many reversals beyond none: dσ/dx = (1 − σ)(1 + (n − 1)σ)."""
    n = values["wen_exponent"]
    left = np.exp(-np.clip(n * beyond, 0.0, 700.0))
    return np.where(beyond < 0.0, beyond, (1.0 - left) / (1.0 + (n - 1.0) * left))


def _wen_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("wen_exponent", LogNormal(1.5, 0.4), "how sudden full friction comes", "Wen 1976", ""),)


def _power(travel: Array, reversal: Array, values: Values) -> Array:
    """A power of the travel up to full sliding: below 1 it rises steeply at once."""
    turn = np.minimum(travel / (WHOLE * values["reversal_mm"]), 1.0)
    return np.asarray(1.0 - turn ** np.minimum(values["reversal_exponent"], STEEPEST))


def _steepness(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("reversal_exponent", LogNormal(0.6, 0.3), "power of the travel", "Swevers 2000", ""),)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("dahl_exponent", Normal(1.0, 0.4), "how the friction's slope fades", "Dahl 1976", ""),)


SAME, NONE_LEFT = 1e-6, 1e-15
"""Exponents as near to 1 as makes no difference; a share of the turn that counts as none."""
AGAINST, REST, SLIDING = 2.0, 1.0, 0.0
"""How far friction turns on a level's first stroke: from against it, since pressurising moved the muscle;
from none; or not at all, since no reversal began the stroke."""
AT_TURN = 1e-4
"""Share of the stroke that a reading has travelled at least. One at the very turn has its branch from whoever
says that it is past it, by less than an encoder tells: a longer reversal still holds it on the old side of
friction, as the equations do, but one that vanishes leaves it on its own, as no presliding does."""
WHOLE = 2.0
"""Reversals in which a power of the travel turns friction over wholly: after one both equations agree."""
MASING = 2.0
"""How much quicker friction builds up from none than it turns over: Masing's rule."""


def _turning(
    left: Callable[[Array, Array, Values], Array], first: float, quicker: float = 1.0, *, once: bool = False
) -> Apply:
    """Friction that turns over, on a level's ``first`` stroke by so much and so much ``quicker``.

    With ``once`` that is the test's very first stroke alone: the others begin where the level before ended.
    A stroke too short for full friction hands on what it reached; strokes alike, one after the other, each
    turn 2/(1 + left(stroke)) over.
    """

    def turned(readings: Readings, values: Values, least: float) -> Array:
        later = readings.test_cycle > 1.0
        reversal = np.where(later, 1.0, readings.reversal) if once else readings.reversal
        one, two = readings.strokes_before.T
        second = (readings.cycle == 1.0) & (~later if once else True)
        left_after_two = np.where(two < FAR, left(two, reversal, values), 0.0)
        before = np.where(second, first, AGAINST / (1.0 + left_after_two))
        missing = np.where(one < FAR, left(one, reversal, values) * before, 0.0)
        swing = first + (AGAINST - missing - first) * reversal
        travel = np.maximum(readings.travel, least) * (quicker + (1.0 - quicker) * reversal)
        return np.asarray(1.0 - swing * left(travel, reversal, values))

    def apply(state: State, values: Values, setting: Setting) -> State:
        own = {name: values[name] for name in OWN if name in values}
        least = AT_TURN * setting.stroke
        if own["reversal_mm"].shape[1] > 1:  # it bends
            return state._replace(sign=state.sign * turned(state.readings, own, least))

        def of(sizes: Array) -> Array:
            return turned(state.readings, dict(zip(own, np.hsplit(sizes, len(own)), strict=True)), least)

        return state._replace(sign=state.sign * over_distinct(np.hstack(list(own.values())), of))

    return apply


register(
    Effect(
        id="presliding",
        stage=Stage.FRICTION,
        title="Presliding",
        sentence="after each turn the friction builds up over some travel instead of at once",
        told_by="small reversals in the middle of the stroke",
        source="Dahl's model at constant load: s(1 − 2 exp(−travel/reversal))",
        parameters=_parameters,
        apply=_turning(_exponential, AGAINST),
        forms={
            "rest": _turning(_exponential, REST),
            "once": _turning(_exponential, REST, once=True),
            "masing": _turning(_exponential, REST, MASING),
            "sliding": _turning(_exponential, SLIDING),
            "ramp": _turning(_ramp, AGAINST),
            "power": _turning(_power, AGAINST),
            "dahl": _turning(_dahl, AGAINST),
            "rest-dahl": _turning(_dahl, REST),
            "once-dahl": _turning(_dahl, REST, once=True),
            "masing-dahl": _turning(_dahl, REST, MASING),
            "sliding-dahl": _turning(_dahl, SLIDING),
            "wen": _turning(_bouc_wen, AGAINST),
            "rest-wen": _turning(_bouc_wen_from_rest, AGAINST),
            "once-wen": _turning(_bouc_wen_from_rest, AGAINST, once=True),
        },
        kinds={
            "rest": "here a level's first stroke starts from rest",
            "once": "here only the test's very first stroke starts from rest",
            "masing": "here a level's first stroke starts from rest, in half the travel",
            "sliding": "here not on a level's first stroke",
            "ramp": "here in proportion to the travel",
        },
        own=dict.fromkeys(DAHL, _exponent) | dict.fromkeys(WEN, _wen_exponent) | {"power": _steepness},
        sources=dict.fromkeys(
            DAHL,
            "Dahl 1976, exponent i after Bliman 1992; i = 1/2: Iwan 1966, Masing's rule with even slip",
        )
        | dict.fromkeys(WEN, "Bouc 1967, Wen 1976 (J. Eng. Mech. Div. 102), β = γ; n = 2: an arc of tanh")
        | {"power": "power law of the hysteresis curve (Swevers et al. 2000, IEEE Trans. Autom. Control 45)"},
        bends={"travel": 3},
        looseness=2.0,
    )
)
