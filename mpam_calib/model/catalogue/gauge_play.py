"""A displacement gauge with play: its pulley, joint or tip follows the muscle only once the play is used up.

No cause of the contract's, and never named (as :mod:`mpam_calib.model.catalogue.load_cell`): the reading
stands at every turn and is off by the play between there and back, so that the loop opens as if something
rubbed.
"""

from __future__ import annotations

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfLongTailed, Parameter, Uniform
from mpam_calib.model.state import Setting, State

USUAL = 0.02
"""Prior scale of the play, as a share of the stroke."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    prior = HalfLongTailed(USUAL * setting.stroke)
    share = "share of the play by which the reading lags while unloading"
    return (
        Parameter("play_mm", prior, "way for which the reading stands at a turn"),
        Parameter("play_share", Uniform(0.0, 1.0), share, unit=""),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    """Shortening grows while unloading (sign −1): ahead of the reading then, behind it while loading."""
    lag = 0.5 - 0.5 * state.readings.sign - (1.0 - values["play_share"])
    lag = np.where(state.readings.sign == 0.0, 0.0, lag)
    return state._replace(displacement=state.displacement + values["play_mm"] * lag)


register(
    Effect(
        id="gauge_play",
        stage=Stage.RIG,
        title="Displacement gauge with play",
        sentence="the displacement stands at every turn until the gauge's play is used up",
        told_by="a second displacement gauge at the muscle's end, there and back once",
        source="shortening = reading + play × (share unloading, share − 1 loading)",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        fault=True,
    )
)
