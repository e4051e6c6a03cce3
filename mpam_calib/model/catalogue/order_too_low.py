"""Order too low: the stress polynomial needs its next power."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LongTailed, Parameter
from mpam_calib.model.reference import reference_shape, rest_of
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import Rest, Shape
from mpam_calib.physics.statics import axial_lever, hoop_lever, strains

Array = NDArray[np.float64]

SHARE = 0.2
"""Prior root mean square of the missing term on the reference grid, as a share of the force scale."""


def _next_power(shape: Shape, rest: Rest, setting: Setting) -> Array:
    """Force per pascal of E_(M+1), m² (thesis Eq. 4.10)."""
    z, x = strains(shape, rest, setting.simulation.strain)
    power = setting.simulation.order + 1
    return axial_lever(shape) * z**power - hoop_lever(shape) * x**power


def _unit(setting: Setting) -> float:
    """Pascals of E_(M+1) whose force has the force scale's root mean square on the grid."""
    shape = reference_shape(setting.geometry, setting.simulation.kinematics)
    force = _next_power(shape, rest_of(setting.geometry), setting)
    return setting.force_scale / float(np.sqrt(np.mean(force**2)))


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("next_order", LongTailed(SHARE), "size of the missing power over the force scale", "", ""),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    assert state.shape is not None
    force = values["next_order"] * _unit(setting) * _next_power(state.shape, state.rest, setting)
    if setting.simulation.law != "constant":
        force = force * state.readings.pressure / setting.top_pressure
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
        bends={"contraction": 4},
        looseness=2.0,
    )
)
