"""Rig compliance: grips, fixture and load cell give way in proportion to the force."""

from __future__ import annotations

import numpy as np

from mpam_calib.model.curves import settled
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfLongTailed, LogNormal, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    # 2 % of the length at the force scale: a soft fixture, not a broken one.
    scale = 0.02 * setting.geometry.L0 / setting.force_scale
    return (Parameter("compliance_mm_per_N", HalfLongTailed(scale), "give of the fixture"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return state._replace(displacement=state.displacement + values["compliance_mm_per_N"] * state.guide)


NEAR = 0.05
"""Share of the force scale below which a power's slope grows no further: it must be finite at no force."""


def _power(state: State, values: Values, setting: Setting) -> State:
    """It stiffens (or softens) with the load by a power, and gives as much at the force scale."""
    load = state.guide / setting.force_scale
    size = (load**2 + NEAR**2) / (1.0 + NEAR**2)
    part = state.guide * np.clip(size, None, 2500.0) ** (0.5 * (values["compliance_exponent"] - 1.0))
    return state._replace(displacement=state.displacement + values["compliance_mm_per_N"] * part)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("compliance_exponent", LogNormal(0.75, 0.3), "power of the force", "textbook", ""),)


def _toe(state: State, values: Values, setting: Setting) -> State:
    """Soft until its slack is taken up, then stiff; it gives as much at the force scale."""
    part = np.sign(state.guide) * settled(np.abs(state.guide), values["toe_N"], setting.force_scale)
    give = values["compliance_mm_per_N"] * setting.force_scale * part
    return state._replace(displacement=state.displacement + give)


def _toe_force(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(setting.force_scale, 0.6)
    return (Parameter("toe_N", prior, "force that takes up the fixture's slack"),)


def _preload(state: State, values: Values, setting: Setting) -> State:
    """Stiff up to the preload of a bolted joint, which then opens; it gives as much at the force scale."""
    scale, preload = setting.force_scale, values["preload_N"]
    stretch = scale / np.maximum(scale - preload, CLOSED * scale)
    beyond = np.sign(state.guide) * np.maximum(np.abs(state.guide) - preload, 0.0)
    give = values["compliance_mm_per_N"] * stretch * beyond
    return state._replace(displacement=state.displacement + give)


CLOSED = 0.2
"""Least share of the force scale over which an open joint gives, whatever its preload."""


def _preload_force(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.15 * setting.force_scale, 0.6)
    return (Parameter("preload_N", prior, "force at which the fixture begins to give"),)


register(
    Effect(
        id="rig_compliance",
        stage=Stage.RIG,
        title="Rig compliance",
        sentence="the fixture gives: under load the muscle is shorter than the crosshead says",
        told_by="a rigid bar in place of the muscle, loaded to the blocked force",
        source="true shortening = reading + compliance × force",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        of_test=True,
        uses_force=True,
        forms={"power": _power, "toe": _toe, "preload": _preload},
        own={"power": _exponent, "toe": _toe_force, "preload": _preload_force},
        sources={
            "power": "Hertz 1882: give ∝ F^(2/3); textbook: F^m",
            "toe": "toe region of ropes and grips (Fung 1967): give ∝ 1 − exp(−F/F_toe)",
            "preload": "preloaded bolted joint, which opens at its preload (Shigley 1963): give ∝ F − F_p",
        },
        bends={"force": 2},
    )
)
