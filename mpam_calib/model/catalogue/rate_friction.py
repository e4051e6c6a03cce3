"""Rate friction: friction depends on the crosshead's speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("rate_per_decade", LongTailed(0.3), "growth of friction per tenfold speed", "", "1/decade"),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    speed = np.where(state.readings.speed > 0.0, state.readings.speed, setting.speed)
    decades = np.log10(speed / setting.speed)
    gain = np.maximum(1.0 + values["rate_per_decade"] * decades, 0.0)
    return replace(state, friction_gain=state.friction_gain * gain)


register(
    Effect(
        id="rate_friction",
        stage=Stage.FRICTION,
        title="Rate-dependent friction",
        sentence="the loop is wider when the crosshead moves faster",
        told_by="the same loop at a third speed, ten times slower or faster",
        source="logarithmic in speed, relative to the geometric mean of the test's speeds",
        parameters=_parameters,
        apply=_apply,
        bends={"speed": 2},
    )
)
