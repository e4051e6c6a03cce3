"""Rate friction: friction depends on the crosshead's speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.friction import strand_friction_per_f_s


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("rate_per_decade", LongTailed(0.3), "growth of friction per tenfold speed", "", "1/decade"),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    speed = np.where(state.readings.speed > 0.0, state.readings.speed, setting.speed)
    decades = np.log10(speed / setting.speed)
    gain = np.maximum(1.0 + values["rate_per_decade"] * decades, 0.0)
    return replace(state, friction_gain=state.friction_gain * gain)


def _viscous(state: State, values: Values, setting: Setting) -> State:
    """Friction beside the declared one, in proportion to the speed and the same at any force.

    The size is what the declared friction would grow by at the force scale, per decade at the mean speed.
    """
    speed = np.where(state.readings.speed > 0.0, state.readings.speed, setting.speed)
    at_scale = state.coulomb * setting.force_scale
    braid = setting.braid
    if braid is not None and np.any(state.strand):
        top = np.array([[setting.top_pressure]])
        unit = strand_friction_per_f_s(top, state.rest.L0, state.rest, braid.E_br, braid.nu_s)
        at_scale = at_scale + state.strand * unit
    added = values["rate_per_decade"] * at_scale * (speed / setting.speed) / np.log(10.0)
    return replace(state, drag=state.drag + added)


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
        forms={"viscous": _viscous},
        kinds={"viscous": "here by friction in proportion to the speed, the same at any force"},
        bends={"speed": 2},
        looseness=2.0,
    )
)
