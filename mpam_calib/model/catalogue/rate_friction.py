"""Rate friction: friction depends on the crosshead's speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.units import MINUTE, MM

REFERENCE_SPEED = 50.0 * MM / MINUTE
"""The thesis's test speed: there the friction is what is declared."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "rate_per_decade", Normal(0.0, 0.3), "growth of friction per tenfold speed", "", "1/decade"
        ),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    speed = np.where(state.readings.speed > 0.0, state.readings.speed, REFERENCE_SPEED)
    decades = np.log10(speed / REFERENCE_SPEED)
    gain = np.maximum(1.0 + values["rate_per_decade"] * decades, 0.0)
    return replace(state, friction_gain=state.friction_gain * gain)


def _linear(state: State, values: Values, setting: Setting) -> State:
    """Friction that grows linearly with speed (viscous), by the same amount over the first decade."""
    speed = np.where(state.readings.speed > 0.0, state.readings.speed, REFERENCE_SPEED)
    gain = 1.0 + values["rate_per_decade"] * (speed / REFERENCE_SPEED - 1.0) / 9.0
    return replace(state, friction_gain=state.friction_gain * np.maximum(gain, 0.0))


def _power(state: State, values: Values, setting: Setting) -> State:
    """Friction that grows with a power of the speed, by the same amount over the first decade."""
    speed = np.where(state.readings.speed > 0.0, state.readings.speed, REFERENCE_SPEED)
    factor = np.maximum(1.0 + values["rate_per_decade"], 0.05) ** np.log10(speed / REFERENCE_SPEED)
    return replace(state, friction_gain=state.friction_gain * factor)


register(
    Effect(
        id="rate_friction",
        stage=Stage.FRICTION,
        title="Rate-dependent friction",
        sentence="the loop is wider when the crosshead moves faster",
        source="logarithmic in speed, relative to 50 mm/min",
        parameters=_parameters,
        apply=_apply,
        forms={"linear": _linear, "power": _power},
        bends={"speed": 2},
    )
)
