"""Braid kinematics: the radius follows the inextensible strands, not a wall of constant thickness."""

from __future__ import annotations

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return ()


def _apply(state: State, values: Values, setting: Setting) -> State:
    # Bent, the strands may lie outside the surface, and the radius then grows more than Eq. 2.10 says.
    return state._replace(kinematics="inextensible_braid", swell=values.get("braid_kinematics", state.swell))


def _swell(state: State, values: Values, setting: Setting) -> State:
    """Strands outside the wall's surface, or a wall not wholly against them: the growth times one factor."""
    return _apply(state, values, setting)._replace(swell=np.maximum(values["braid_swell"], 0.05))


def _thickness(state: State, values: Values, setting: Setting) -> State:
    """The radius follows the strands and the wall still keeps its thickness."""
    return state._replace(kinematics="braid_of_constant_thickness")


def _thin(state: State, values: Values, setting: Setting) -> State:
    """The radius follows the strands and the wall's volume is reckoned as a thin wall's."""
    return state._replace(kinematics="braid_of_thin_wall")


def _section(state: State, values: Values, setting: Setting) -> State:
    """The radius follows the strands and the wall thins as it is stretched round."""
    return state._replace(kinematics="braid_of_thin_section")


def _factor(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("braid_swell", Normal(1.0, 0.1), "the radius's growth over Eq. 2.10's", "", ""),)


register(
    Effect(
        id="braid_kinematics",
        stage=Stage.SHAPE,
        title="Braid kinematics",
        sentence="the radius follows the strands of the sleeve, not the wall's constant thickness",
        told_by="the outer diameter, measured along the stroke",
        source="thesis Eq. 2.10, 2.23 in place of Eq. 4.16",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={"swell": _swell, "thickness": _thickness, "thin": _thin, "section": _section},
        own={"swell": _factor},
        sources={
            "swell": "Eq. 2.10 for strands a distance δ outside the wall: growth × (1 + δ/R0)",
            "thickness": "Eq. 2.10 with the declared t0 at any length (Chou & Hannaford 1996)",
            "thin": "Eq. 2.10 with t = t0 R0 L0/(R L), the volume of a thin wall",
            "section": "Eq. 2.10 with t = t0 R0/R, a thin wall stretched round alone (plane strain)",
        },
        bends={"contraction": 2},
    )
)
