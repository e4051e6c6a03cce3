"""Pressure droop: at full stroke the muscle's pressure is below the reading at the regulator."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import level_stroke, middle_pressure, over_mean, power, signed_power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfLongTailed, LogNormal, Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHORTEST, radius_inextensible_braid
from mpam_calib.units import ATMOSPHERE

Array = NDArray[np.float64]

MOST_LOST = 0.9
"""Of the pressure above a vacuum, however large the droop."""
LAG_SHARE, PLAY_SHARE, FLOW_STEP = 0.1, 0.1, 1e-3
"""A supply's typical lag over a stroke's time, its play over the stroke, and a step that tells a slope."""
NO_WAY, NO_PLACE = 1e-12, 1e-9
"""A way and a place (m) as good as none."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("droop_percent", HalfLongTailed(0.05), "pressure missing in the muscle at full stroke"),
    )


def _drooped(state: State, values: Values, part: Array) -> State:
    """With this part (B or 1, n) of the droop at full stroke."""
    return state._replace(pressure=state.pressure * (1.0 - values["droop_percent"] * part))


def _apply(state: State, values: Values, setting: Setting) -> State:
    return _drooped(state, values, state.displacement / setting.stroke)


def _level(state: State, values: Values, setting: Setting) -> State:
    """In proportion to each level's own stroke."""
    return _drooped(state, values, state.displacement / level_stroke(state, setting))


def _power(state: State, values: Values, setting: Setting) -> State:
    """A power of the stroke: with its square, or all but at its end; less than 1 as the volume grows."""
    part = signed_power(state.displacement / setting.stroke, values["droop_exponent"])
    return _drooped(state, values, part)


def _square(state: State, values: Values, setting: Setting) -> State:
    """With the square of the stroke."""
    return _power(state, {**values, "droop_exponent": np.full((1, 1), 2.0)}, setting)


def _level_power(state: State, values: Values, setting: Setting) -> State:
    """A power of each level's own stroke."""
    part = signed_power(state.displacement / level_stroke(state, setting), values["droop_exponent"])
    return _drooped(state, values, part)


def _loss(state: State, values: Values, setting: Setting) -> State:
    """Lost by another power of the pressure than 1: 0 is the same at every level, 1/2 an orifice's."""
    ratio = power(state.pressure / middle_pressure(setting), values["loss_exponent"] - 1.0)
    return _drooped(state, values, ratio * state.displacement / setting.stroke)


def _loss_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("loss_exponent", Normal(0.4, 0.4), "power of the pressure", "textbook", ""),)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("droop_exponent", LogNormal(1.5, 0.5), "power of the stroke", "textbook", ""),)


def _saturating(state: State, values: Values, setting: Setting) -> State:
    """Most of it early in the stroke: an exponential approach, of which a whole stroke is the droop."""
    steep = values["droop_steepness"]
    place = np.maximum(state.displacement, 0.0) / setting.stroke
    return _drooped(state, values, np.expm1(-steep * place) / np.expm1(-steep))


def _steepness(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("droop_steepness", LogNormal(2.0, 0.7), "how early in the stroke", "", ""),)


def _speed(state: State, values: Values, setting: Setting) -> State:
    """More of it the faster the stroke, by a power: 1 where the line's flow is laminar, 2 where it is not."""
    growth = power(over_mean(state.readings.pace, setting), values["flow_exponent"])
    return _drooped(state, values, growth * state.displacement / setting.stroke)


def _flow_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("flow_exponent", Normal(0.5, 0.5), "power of the speed", "textbook", ""),)


def _lagging(state: State, values: Values, setting: Setting) -> State:
    """The droop follows the stroke with a lag τ: v·τ behind it, gradually after a turn (at one speed v)."""
    return _drooped(state, values, _place(state, values) / setting.stroke)


def _play(state: State, values: Values, setting: Setting) -> State:
    """The droop follows the stroke with play: it stays at each turn until twice the play is passed."""
    play, readings = values["supply_play_mm"], state.readings
    behind = np.minimum(readings.travel - play * readings.reversal, play)
    place = np.maximum(state.displacement + readings.sign * behind, 0.0)
    return _drooped(state, values, place / setting.stroke)


def _play_way(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(PLAY_SHARE * setting.stroke, 0.7)
    return (Parameter("supply_play_mm", prior, "half the stroke that turns before the supply does", ""),)


def _throttle(state: State, values: Values, setting: Setting) -> State:
    """Lost with the flow that the volume's growth asks for; on the way back too much, in part or whole."""
    step = FLOW_STEP * setting.stroke

    def growth(place: Array) -> Array:
        return _filled(place + step, state, setting) - _filled(place - step, state, setting)

    flow = growth(state.displacement) / growth(np.full((1, 1), 0.5 * setting.stroke))
    way = np.where(state.readings.sign < 0.0, 1.0, -values["vented_share"])
    return _drooped(state, values, 0.5 * way * flow * over_mean(state.readings.speed, setting))


def _vented(setting: Setting) -> tuple[Parameter, ...]:
    prior = Normal(0.5, 0.4)
    return (Parameter("vented_share", prior, "of the loss, that the way back shows the other way", "", ""),)


def _volume(state: State, values: Values, setting: Setting) -> State:
    """The same in proportion to the volume that the braid encloses and the supply has to fill."""
    return _drooped(state, values, _filled(_place(state, values), state, setting))


def _reservoir(state: State, values: Values, setting: Setting) -> State:
    """A closed supply that expands into that volume: its pressure above a vacuum falls as 1/(1 + z·V)."""
    middle = middle_pressure(setting)
    lost = np.minimum(values["droop_percent"] * middle / (middle + ATMOSPHERE), MOST_LOST)
    filled = _filled(np.maximum(state.displacement, 0.0), state, setting)
    expanded = 1.0 + lost / (1.0 - lost) * filled
    return state._replace(pressure=(state.pressure + ATMOSPHERE) / expanded - ATMOSPHERE)


def _filled(place: Array, state: State, setting: Setting) -> Array:
    """Volume inside the braid since the start of the stroke, as a share of a whole stroke's."""

    def volume(shortening: Array) -> Array:
        length = np.maximum(state.rest.L0 - shortening, SHORTEST * state.rest.L0)
        return np.asarray(radius_inextensible_braid(length, state.rest) ** 2 * length)

    at_rest, full = volume(np.zeros((1, 1))), volume(np.full((1, 1), setting.stroke))
    return np.asarray((volume(place) - at_rest) / (full - at_rest))


def _refill(state: State, values: Values, setting: Setting) -> State:
    """What is missing grows with the volume while the supply refills it, dq/dt = dV/dt − q/τ.

    What is too much leaves at once (q ≥ 0), so that every contraction starts with none missing; each stroke
    is taken to have one speed, and the volume to grow evenly up to where it is.
    """
    readings = state.readings
    way = np.maximum(readings.pace * values["refill_s"], NO_WAY)
    contracting = -way * np.expm1(-readings.travel / way)
    at_turn = -way * readings.reversal * np.expm1(-(state.displacement + readings.travel) / way)
    lengthening = (at_turn + way) * np.exp(-readings.travel / way) - way
    missing = np.where(readings.sign < 0.0, contracting, np.maximum(lengthening, 0.0))
    place = np.maximum(state.displacement, NO_PLACE)
    return _drooped(state, values, missing / place * _filled(place, state, setting))


def _place(state: State, values: Values) -> Array:
    """Where the supply has got to, m (at least the start of the stroke)."""
    readings = state.readings
    way = np.maximum(readings.pace * values["supply_lag_s"], NO_WAY)
    behind = way * (1.0 - (1.0 + readings.reversal) * np.exp(-readings.travel / way))
    return np.maximum(state.displacement + readings.sign * behind, 0.0)


def _lag(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(LAG_SHARE * _stroke_time(setting), 0.7)
    return (Parameter("supply_lag_s", prior, "time in which the supply follows the stroke", "textbook"),)


def _refill_time(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(_stroke_time(setting), 1.0)
    return (Parameter("refill_s", prior, "time in which the supply refills the muscle", "textbook"),)


def _stroke_time(setting: Setting) -> float:
    """A stroke's time at the test's mean speed, s."""
    return setting.stroke / setting.speed if setting.speed > 0.0 else 1.0


register(
    Effect(
        id="pressure_droop",
        stage=Stage.RIG,
        title="Pressure droop",
        sentence="the supply does not hold the pressure: at full stroke the muscle sees less than the gauge",
        told_by="a pressure sensor at the muscle itself, or the same loop at a tenth of the speed",
        resolution={"droop_percent": 0.005},
        source="first order in the stroke: P(1 − droop·x/stroke)",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={
            "level": _level,
            "power": _power,
            "square": _square,
            "level-power": _level_power,
            "saturating": _saturating,
            "loss": _loss,
            "speed": _speed,
            "lagging": _lagging,
            "play": _play,
            "throttle": _throttle,
            "volume": _volume,
            "reservoir": _reservoir,
            "refill": _refill,
        },
        own=dict.fromkeys(("power", "level-power"), _exponent)
        | dict.fromkeys(("lagging", "volume"), _lag)
        | {"loss": _loss_exponent, "speed": _flow_exponent, "refill": _refill_time}
        | {"saturating": _steepness, "play": _play_way, "throttle": _vented},
        recalls=("speed", "lagging", "play", "throttle", "volume", "refill"),
        sources={
            "power": "textbook: a power of the stroke; near 0.8 in proportion to the muscle's volume",
            "square": "textbook: quadratic in the stroke",
            "level-power": "the same over each level's own stroke",
            "saturating": "textbook: exponential approach to a new balance, 1 − exp(−k·x), over the stroke",
            "loss": "textbook: a loss that is the same at every pressure, or goes with its root (orifice)",
            "speed": "line losses: Hagen-Poiseuille ∝ flow, turbulent or orifice ∝ flow²",
            "lagging": "textbook: first-order lag of a regulator or a line, τ·dy/dt + y = x",
            "play": "textbook: a regulator's hysteresis, as the play of a gear (backlash)",
            "throttle": "line loss in proportion to the flow, P − R·dV/dt, which a vent relieves in part",
            "volume": "a lag of the muscle's volume πR²L in place of its stroke",
            "reservoir": "Boyle's law of a supply that is shut off: (P + P_atm)·V = constant",
            "refill": "mass balance of a muscle behind a throttle: dq/dt = dV/dt − q/τ, q ≥ 0",
        },
        kinds={"level": "here full stroke is each level's own"},
        bends={"contraction": 3, "pace": 1},
        looseness=2.0,
    )
)
