"""Order too low: the stress polynomial needs its next power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import middle_pressure
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Normal, Parameter
from mpam_calib.model.reference import reference_shape, rest_of
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import Rest, Shape
from mpam_calib.physics.statics import axial_lever, hoop_lever, strains

Array = NDArray[np.float64]

STRAIGHT = np.zeros((1, 1))
"""No hardening."""
SHARE = 0.2
"""Prior root mean square of the missing term on the reference grid, as a share of the force scale."""


def _next_power(shape: Shape, rest: Rest, setting: Setting, hardening: Array) -> Array:
    """Force per pascal of E_(M+1), m² (thesis Eq. 4.10), each stress times e^(hardening·strain)."""
    z, x = strains(shape, rest, setting.simulation.strain)
    power = setting.simulation.order + 1
    axial, hoop = (s**power * np.exp(np.clip(hardening * s, -30.0, 30.0)) for s in (z, x))
    return axial_lever(shape) * axial - hoop_lever(shape) * hoop


def _term(state: State, values: Values, setting: Setting, hardening: Array) -> Array:
    """The missing term, N: its root mean square on the grid is ``next_order`` of the force scale."""
    assert state.shape is not None
    grid = reference_shape(setting.geometry, setting.simulation.kinematics)
    force = _next_power(grid, rest_of(setting.geometry), setting, hardening)
    unit = setting.force_scale / np.sqrt(np.mean(force**2, axis=-1, keepdims=True))
    size: Array = values["next_order"] * unit
    return size * _next_power(state.shape, state.rest, setting, hardening)


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("next_order", LongTailed(SHARE), "size of the missing power over the force scale", "", ""),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    return _with_the_law(state, setting, _term(state, values, setting, STRAIGHT))


def _with_the_law(state: State, setting: Setting, force: Array) -> State:
    """With a term that grows with the pressure, if the others do."""
    if setting.simulation.law != "constant":
        force = force * state.readings.pressure / setting.top_pressure
    return replace(state, lost=state.lost - force)


def _fung(state: State, values: Values, setting: Setting) -> State:
    """The missing term hardens exponentially with the strain; below 0 it softens."""
    return _with_the_law(state, setting, _term(state, values, setting, values["hardening"]))


def _hardening(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("hardening", Normal(0.0, 1.5), "exponent of the strain on top of the power", "", ""),)


def _steady(state: State, values: Values, setting: Setting) -> State:
    """The missing term is the same at every pressure, whatever the law of the others."""
    force = _term(state, values, setting, STRAIGHT)
    if setting.simulation.law != "constant":
        force = force * middle_pressure(setting) / setting.top_pressure
    return replace(state, lost=state.lost - force)


register(
    Effect(
        id="order_too_low",
        stage=Stage.STATICS,
        title="Order too low",
        sentence="the stress polynomial needs a higher order than declared",
        told_by="a tensile test of the bladder up to the strains of the muscle",
        source="thesis Eq. 2.12 with M + 1 terms",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={"fung": _fung, "steady": _steady},
        own={"fung": _hardening},
        sources={
            "fung": "exponential hardening (Fung 1967); Gent 1996 and Ogden 1972 to the same order",
            "steady": "Mooney-Rivlin or Yeoh 1993 term with a constant modulus",
        },
        bends={"contraction": 4},
        looseness=2.0,
    )
)
