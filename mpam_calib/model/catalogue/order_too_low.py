"""Order too low: the stress polynomial needs its next power."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import middle_pressure
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.reference import reference_shape, rest_of
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import Rest, Shape
from mpam_calib.physics.statics import axial_lever, hoop_lever, strains

Array = NDArray[np.float64]

Harder = Callable[[Array], Array]
"""What a stress is multiplied with at a strain."""
AT_LIMIT = 0.05
"""Least that is left of 1 − (e/e_lim)²: no reading is beyond the limit."""
SHARE = 0.2
"""Prior root mean square of the missing term on the reference grid, as a share of the force scale."""


def _next_power(shape: Shape, rest: Rest, setting: Setting, harder: Harder) -> Array:
    """Force per pascal of E_(M+1), m² (thesis Eq. 4.10), each stress times ``harder`` of its strain."""
    z, x = strains(shape, rest, setting.simulation.strain)
    power = setting.simulation.order + 1
    axial, hoop = (s**power * harder(s) for s in (z, x))
    return axial_lever(shape) * axial - hoop_lever(shape) * hoop


def _term(state: State, values: Values, setting: Setting, harder: Harder = np.ones_like) -> Array:
    """The missing term, N: its root mean square on the grid is ``next_order`` of the force scale."""
    assert state.shape is not None
    grid = reference_shape(setting.geometry, setting.simulation.kinematics)
    force = _next_power(grid, rest_of(setting.geometry), setting, harder)
    unit = setting.force_scale / np.sqrt(np.mean(force**2, axis=-1, keepdims=True))
    size: Array = values["next_order"] * unit
    return size * _next_power(state.shape, state.rest, setting, harder)


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("next_order", LongTailed(SHARE), "size of the missing power over the force scale", "", ""),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    return _with_the_law(state, setting, _term(state, values, setting))


def _with_the_law(state: State, setting: Setting, force: Array) -> State:
    """With a term that grows with the pressure, if the others do."""
    if setting.simulation.law != "constant":
        force = force * state.readings.pressure / setting.top_pressure
    return replace(state, lost=state.lost - force)


def _fung(state: State, values: Values, setting: Setting) -> State:
    """The missing term hardens exponentially with the strain; below 0 it softens."""

    def harder(strain: Array) -> Array:
        return np.asarray(np.exp(np.clip(values["hardening"] * strain, -30.0, 30.0)))

    return _with_the_law(state, setting, _term(state, values, setting, harder))


def _hardening(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("hardening", Normal(0.0, 1.5), "exponent of the strain on top of the power", "", ""),)


def _gent(state: State, values: Values, setting: Setting) -> State:
    """The missing term hardens without bound as the strain nears a limit, from both sides alike."""

    def harder(strain: Array) -> Array:
        return np.asarray(1.0 / np.maximum(1.0 - (strain / values["limit_strain"]) ** 2, AT_LIMIT))

    return _with_the_law(state, setting, _term(state, values, setting, harder))


def _limit(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("limit_strain", LogNormal(2.0, 0.5), "strain that the wall cannot reach", "", ""),)


def _steady(state: State, values: Values, setting: Setting) -> State:
    """The missing term is the same at every pressure, whatever the law of the others."""
    force = _term(state, values, setting)
    if setting.simulation.law != "constant":
        force = force * middle_pressure(setting) / setting.top_pressure
    return replace(state, lost=state.lost - force)


def _line(state: State, values: Values, setting: Setting) -> State:
    """The missing modulus has a line of its own in pressure, as the others of a linear law have."""
    force = _term(state, values, setting)
    if setting.simulation.law != "constant":
        share = values["steady_share"]
        pressure = (1.0 - share) * state.readings.pressure + share * middle_pressure(setting)
        force = force * pressure / setting.top_pressure
    return replace(state, lost=state.lost - force)


def _steady_share(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter("steady_share", Normal(0.5, 1.0), "share of the term that no pressure changes", "", ""),
    )


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
        forms={"line": _line, "fung": _fung, "gent": _gent, "steady": _steady},
        own={"line": _steady_share, "fung": _hardening, "gent": _limit},
        sources={
            "line": "thesis Eq. 4.7 for the missing modulus: a line of its own in pressure",
            "fung": "exponential hardening (Fung 1967); Ogden 1972 to the same order",
            "gent": "limiting extensibility, 1/(1 − J/J_m) with J ∝ e² (Gent 1996, doi:10.5254/1.3538357)",
        },
        kinds={"steady": "here by a modulus that is the same at any pressure"},
        bends={"contraction": 4},
        looseness=2.0,
    )
)
