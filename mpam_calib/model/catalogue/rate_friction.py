"""Rate friction: friction depends on the crosshead's speed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import box_cox, over_mean, signed_power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.friction import strand_friction_per_f_s

Array = NDArray[np.float64]


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "rate_per_decade", LongTailed(0.3), "change of friction for ten times the speed", "", "1/decade"
        ),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    return _gained(state, values, np.log10(over_mean(state.readings.speed, setting)))


def _stroke(state: State, values: Values, setting: Setting) -> State:
    """By the stroke's own speed: what the crosshead does at the turns does not count."""
    return _gained(state, values, np.log10(over_mean(state.readings.pace, setting)))


def _gained(state: State, values: Values, decades: Array) -> State:
    gain = np.maximum(1.0 + values["rate_per_decade"] * decades, 0.0)
    return state._replace(friction_gain=state.friction_gain * gain)


def _viscous(state: State, values: Values, setting: Setting) -> State:
    """Friction beside the declared one, in proportion to the speed and the same at any force.

    The size is what the declared friction would grow by at the force scale, per decade at the mean speed.
    """
    return _dragged(state, values, setting, over_mean(state.readings.speed, setting))


def _dragged(state: State, values: Values, setting: Setting, growth: Array) -> State:
    added = values["rate_per_decade"] * _at_scale(state, setting) * growth / np.log(10.0)
    return state._replace(drag=state.drag + added)


def _at_scale(state: State, setting: Setting) -> Array:
    """The declared friction at the force scale, or at the top pressure, N."""
    at_scale = state.coulomb * setting.force_scale
    braid = setting.braid
    if braid is not None and np.any(state.strand):
        top = np.array([[setting.top_pressure]])
        unit = strand_friction_per_f_s(top, state.rest.L0, state.rest, braid.E_br, braid.nu_s)
        at_scale = at_scale + state.strand * unit
    return np.asarray(at_scale)


def _power(state: State, values: Values, setting: Setting) -> State:
    """A power of the speed: 0 is the logarithm, 1 a straight line, below 0 it levels off, as Stribeck's."""
    growth = box_cox(over_mean(state.readings.speed, setting), values["speed_exponent"])
    return _gained(state, values, growth / np.log(10.0))


def _stroke_power(state: State, values: Values, setting: Setting) -> State:
    """Such a power of the stroke's own speed."""
    growth = box_cox(over_mean(state.readings.pace, setting), values["speed_exponent"])
    return _gained(state, values, growth / np.log(10.0))


def _stribeck(state: State, values: Values, setting: Setting) -> State:
    """Stribeck's curve: what falls with such a power of the speed, and a part that rises with the speed."""
    speed = over_mean(state.readings.speed, setting)
    growth = box_cox(speed, values["speed_exponent"]) + values["viscous_share"] * (speed - 1.0)
    return _gained(state, values, growth / np.log(10.0))


def _stribeck_shape(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("speed_exponent", Normal(-0.5, 0.5), "power of the speed", "textbook", ""),
        Parameter("viscous_share", Normal(0.0, 0.5), "viscous part over that one", "textbook", ""),
    )


def _speed_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("speed_exponent", Normal(0.5, 0.5), "power of the speed", "textbook", ""),)


def _drag(state: State, values: Values, setting: Setting) -> State:
    """Beside the declared friction and the same at any force, as "viscous", but a power of the speed."""
    speed = over_mean(state.readings.speed, setting)
    return _dragged(state, values, setting, signed_power(speed, values["drag_exponent"]))


def _stroke_drag(state: State, values: Values, setting: Setting) -> State:
    """Such a power of the stroke's own speed."""
    pace = over_mean(state.readings.pace, setting)
    return _dragged(state, values, setting, signed_power(pace, values["drag_exponent"]))


def _drag_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("drag_exponent", LogNormal(0.5, 0.5), "power of the speed", "textbook", ""),)


register(
    Effect(
        id="rate_friction",
        stage=Stage.FRICTION,
        title="Rate-dependent friction",
        sentence="friction depends on speed: the loop is wider, or narrower, when the crosshead moves faster",
        told_by="the same loop at one more speed, ten times slower or faster",
        source="logarithmic in speed, relative to the geometric mean of the test's speeds",
        parameters=_parameters,
        apply=_apply,
        comes_last=True,
        forms={
            "viscous": _viscous,
            "power": _power,
            "stribeck": _stribeck,
            "drag": _drag,
            "stroke": _stroke,
            "stroke-power": _stroke_power,
            "stroke-drag": _stroke_drag,
        },
        own={
            "power": _speed_exponent,
            "stribeck": _stribeck_shape,
            "drag": _drag_exponent,
            "stroke-power": _speed_exponent,
            "stroke-drag": _drag_exponent,
        },
        sources={
            "power": "friction 1 + r(v^n − 1)/n: power law, viscous (n = 1), near Stribeck 1902 for n < 0",
            "stribeck": "Stribeck 1902, with viscous friction (Armstrong-Hélouvry et al. 1994)",
            "drag": "Herschel & Bulkley 1926: beside dry friction a part ∝ v^n",
            "stroke": "textbook: the same logarithm, of the stroke's own speed",
            "stroke-power": "textbook: friction 1 + r(v^n − 1)/n with the stroke's own speed v",
            "stroke-drag": "textbook: beside dry friction a part ∝ v^n, of the stroke's own speed v",
        },
        kinds={"viscous": "here by friction in proportion to the speed, the same at any force"},
        bends={"speed": 2},
        looseness=2.0,
    )
)
