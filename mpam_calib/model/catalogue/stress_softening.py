"""Stress softening (Mullins): the first cycles are stiffer."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import special

from mpam_calib.model.curves import level_stroke
from mpam_calib.model.effect import Apply, Effect, Share, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, NormalWithin, Parameter
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]
Fading = Callable[[Array, Values], Array]
"""How much of the excess is left from cycle to cycle, from 1 to 0."""

POWERS = ("power", "force-power", "test-power", "test-force-power")
REACHING = ("virgin", "fresh", "test-virgin", "test-force-virgin")
FADING = ("virgin-fading", "force-fading")
WORN = ("worn", "test-worn")
GROWING = ("growing", "force-growing")
RECOVERING = ("recovering", "force-recovering")


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("first_cycle_fraction", LongTailed(0.2), "how much stiffer the first cycle is", "", ""),
    )


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("cycle_exponent", LogNormal(0.8, 0.6), "power of the cycle count", "textbook", ""),)


def _reach(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "softening_reach", LogNormal(0.3, 0.5), "share of the stroke over which it softens", "", ""
        ),
    )


def _reach_and_power(setting: Setting) -> tuple[Parameter, ...]:
    power = Parameter("softening_power", LogNormal(0.8, 0.4), "power of the way in its exponent", "", "")
    return (*_reach(setting), power)


def _reach_and_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (*_reach(setting), *_exponent(setting))


def _exponential(cycle: Array, values: Values) -> Array:
    return np.exp(1.0 - cycle)


def _power(cycle: Array, values: Values) -> Array:
    """Slow, or all but the first cycle's alone."""
    return np.asarray(cycle ** -np.minimum(values["cycle_exponent"], 20.0))


def _constant(cycle: Array, values: Values) -> Array:
    return np.ones_like(cycle)


def _by_cycle(fading: Fading, over_test: bool = False) -> Share:
    """By a level's cycles, or the whole test's: what has softened stays soft at the levels that follow."""

    def share(state: State, values: Values, setting: Setting) -> Array:
        return fading(state.readings.test_cycle if over_test else state.readings.cycle, values)

    return share


def _recovering(state: State, values: Values, setting: Setting) -> Array:
    """A part of what has softened recovers before each level, the rest stays soft for the whole test."""
    share, cycles = values["softening_recovers"], values["softening_cycles"]
    anew, once = (np.exp((1.0 - n) / cycles) for n in (state.readings.cycle, state.readings.test_cycle))
    return np.asarray(share * anew + (1.0 - share) * once)


def _recovery(setting: Setting) -> tuple[Parameter, ...]:
    # A climb would never leave a bound that cuts the share off: beyond it nothing moves the force.
    within = NormalWithin(0.5, 0.4, 0.0, 1.0)
    share = Parameter("softening_recovers", within, "share that recovers before a level", "", "")
    return share, _cycles()


def _cycles() -> Parameter:
    return Parameter("softening_cycles", LogNormal(1.2, 0.6), "cycles in which it softens", "", "")


def _by_stretch(fading: Fading, over_test: bool = False) -> Share:
    """As new where it had never been stretched so far; from then on the softer, the farther from there."""

    def share(state: State, values: Values, setting: Setting) -> Array:
        way = _way_to_farthest(state, setting, over_test)
        near = special.erfc(way / setting.stroke / values["softening_reach"])
        return np.asarray(near * fading(state.readings.cycle, values))

    return share


def _worn(over_test: bool) -> Share:
    """As new where it had never been stretched so far; from there on by a steep exponential of the way."""

    def share(state: State, values: Values, setting: Setting) -> Array:
        way = _way_to_farthest(state, setting, over_test)
        shares = way / setting.stroke / values["softening_reach"]
        return np.asarray(np.exp(-(shares ** values["softening_power"])))

    return share


def _growing(state: State, values: Values, setting: Setting) -> Array:
    """The more, the farther the bladder is stretched: as much as the plain form's at half the stroke."""
    along = 1.0 + values["softening_growth"] * (state.displacement / setting.stroke - 0.5)
    return np.asarray(along * np.exp((1.0 - state.readings.cycle) / values["softening_cycles"]))


def _growth(setting: Setting) -> tuple[Parameter, ...]:
    growth = Parameter("softening_growth", Normal(0.8, 0.5), "how much it grows along the stroke", "", "")
    return growth, _cycles()


def _fresh(state: State, values: Values, setting: Setting) -> Array:
    """Beside a bladder once stretched: the excess of the first stroke, gone at its end, by energies ∝ x²."""
    new = (state.readings.cycle < 1.5) & (state.readings.sign < 0.0)
    reached = np.minimum(state.readings.displacement / level_stroke(state, setting), 1.0)
    return np.where(new, special.erf((1.0 - reached**2) / values["softening_reach"]), 0.0)


def _path(state: State, values: Values, setting: Setting) -> Array:
    """By the way since the level was reached, forth and back: it softens within a stroke as well."""
    stroke = level_stroke(state, setting)
    part = np.minimum(state.readings.displacement / stroke, 1.0)
    strokes = 2.0 * (state.readings.cycle - 1.0) + np.where(state.readings.sign < 0.0, part, 2.0 - part)
    return np.asarray(np.exp(-strokes * stroke / setting.stroke / values["softening_strokes"]))


def _strokes(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(2.0, 0.7)
    return (
        Parameter("softening_strokes", prior, "longest strokes in whose way it softens", "Miehe 1995", ""),
    )


def _way_to_farthest(state: State, setting: Setting, over_test: bool) -> Array:
    """Way (m) to the farthest stretch so far, of the whole test or of the level alone."""
    return state.readings.behind if over_test else _level_way(state, setting)


def _level_way(state: State, setting: Setting) -> Array:
    """Way (m) to the level's longest stroke; none on its first, which stretches the bladder anew."""
    new = (state.readings.cycle < 1.5) & (state.readings.sign < 0.0)
    way = np.maximum(level_stroke(state, setting) - state.readings.displacement, 0.0)
    return np.where(new, 0.0, way)


def _bladder(share: Share) -> Apply:
    def apply(state: State, values: Values, setting: Setting) -> State:
        gain = 1.0 + values["first_cycle_fraction"] * share(state, values, setting)
        return state._replace(wall_gain=state.wall_gain * gain)

    return apply


def _muscle(share: Share) -> Apply:
    """The whole muscle is stiffer, not the bladder alone."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        gain = 1.0 + values["first_cycle_fraction"] * share(state, values, setting)
        return state._replace(gain=state.gain * gain)

    return apply


register(
    Effect(
        id="stress_softening",
        stage=Stage.HISTORY,
        title="Stress softening",
        sentence="the bladder is stiffer in its first cycles and softens with use (Mullins)",
        told_by="five more cycles at one level, and the first level again at the end",
        source="exponential in the cycle count: bladder stress × (1 + fraction·e^(1 − cycle))",
        parameters=_parameters,
        apply=_bladder(_by_cycle(_exponential)),
        forms={
            "force": _muscle(_by_cycle(_exponential)),
            "test": _bladder(_by_cycle(_exponential, over_test=True)),
            "test-force": _muscle(_by_cycle(_exponential, over_test=True)),
            "power": _bladder(_by_cycle(_power)),
            "force-power": _muscle(_by_cycle(_power)),
            "test-power": _bladder(_by_cycle(_power, over_test=True)),
            "test-force-power": _muscle(_by_cycle(_power, over_test=True)),
            "virgin": _bladder(_by_stretch(_constant)),
            "virgin-fading": _bladder(_by_stretch(_power)),
            "force-fading": _muscle(_by_stretch(_power)),
            "fresh": _bladder(_fresh),
            "path": _bladder(_path),
            "worn": _bladder(_worn(over_test=False)),
            "test-worn": _bladder(_worn(over_test=True)),
            "growing": _bladder(_growing),
            "force-growing": _muscle(_growing),
            "recovering": _bladder(_recovering),
            "force-recovering": _muscle(_recovering),
            "test-virgin": _bladder(_by_stretch(_constant, over_test=True)),
            "test-force-virgin": _muscle(_by_stretch(_constant, over_test=True)),
        },
        own=dict.fromkeys(POWERS, _exponent)
        | dict.fromkeys(REACHING, _reach)
        | dict.fromkeys(FADING, _reach_and_exponent)
        | dict.fromkeys(RECOVERING, _recovery)
        | dict.fromkeys(GROWING, _growth)
        | dict.fromkeys(WORN, _reach_and_power)
        | {"path": _strokes},
        apart=("virgin-fading", "force-recovering"),
        sources=dict.fromkeys(POWERS, "textbook: power of the cycle count (steep: the first cycle alone)")
        | dict.fromkeys(
            (*REACHING, *FADING),
            "Ogden & Roxburgh 1999, with the distance to the longest stroke in place of energies",
        )
        | dict.fromkeys(RECOVERING, "softening of which a part recovers at rest (Diani et al. 2009)")
        | dict.fromkeys(GROWING, "textbook: the more the farther it is stretched, less with every cycle")
        | dict.fromkeys(
            WORN, "e^(−(way/s)ᵖ), with p of a half Beatty & Krishnaswamy 2000, with one an exponential"
        )
        | {"path": "continuous damage: e^(−way/s) (Miehe 1995, Eur. J. Mech. A 14)"},
        kinds={
            "force": "here the whole muscle, not the bladder alone",
            "test": "here in the first cycles of the whole test, not of each level",
            "test-force": "here the whole muscle, in the first cycles of the whole test, not of each level",
        },
        bends={"cycle": 2, "cycles": 1, "contraction": 1, "branch": 1},
        looseness=3.0,
    )
)
