"""Braid angle: the sleeve's true angle at rest differs from the declared one."""

from __future__ import annotations

import numpy as np

from mpam_calib.model.curves import middle_pressure, power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.units import DEG

LIMITS = (5.0 * DEG, 89.0 * DEG)
OWN_SD = 2.0 * DEG
"""Prior sd of an angle of which none is declared."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    declared = setting.geometry.sd.alpha0_deg * DEG
    # The declared sd, but with long tails: an angle that is said to be known well may be wrong all the same.
    prior = LongTailed(declared / LongTailed(1.0).sd) if declared > 0.0 else Normal(0.0, OWN_SD)
    return (Parameter("delta_alpha_deg", prior, "true braid angle minus the declared one"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    alpha0 = np.clip(state.rest.alpha0 + values["delta_alpha_deg"], *LIMITS)
    return state._replace(rest=state.rest._replace(alpha0=alpha0))


def _seating(state: State, values: Values, setting: Setting) -> State:
    """The strands seat themselves: the angle is off by a power of the pressure."""
    part = power(state.pressure / middle_pressure(setting), values["seating_exponent"])
    return _apply(state, {**values, "delta_alpha_deg": values["delta_alpha_deg"] * part}, setting)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("seating_exponent", Normal(0.0, 0.5), "power of the pressure", "textbook", ""),)


register(
    Effect(
        id="braid_angle",
        stage=Stage.SHAPE,
        title="Braid angle",
        sentence="the sleeve's angle at rest is not the declared one",
        told_by="the braid angle, measured on a photograph at rest",
        resolution={"delta_alpha_deg": 0.5 * DEG},
        source="thesis Eq. 2.1-2.3 with another α0",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        of_test=True,
        forms={"seating": _seating},
        own={"seating": _exponent},
        sources={"seating": "textbook: an angle that is off by δ·(P/P_middle)^m"},
        bends={"contraction": 1, "pressure": 2},
    )
)
