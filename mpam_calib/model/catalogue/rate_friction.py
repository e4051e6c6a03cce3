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


register(
    Effect(
        id="rate_friction",
        stage=Stage.FRICTION,
        title="Rate-dependent friction",
        sentence="the loop is wider when the crosshead moves faster",
        source="logarithmic in speed, relative to 50 mm/min",
        parameters=_parameters,
        apply=_apply,
    )
)
