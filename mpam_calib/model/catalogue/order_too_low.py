"""Order too low: the stress polynomial needs its next power."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import middle_pressure
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.reference import reference_shape, rest_of
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHAPES, SHORTEST, Rest, Shape
from mpam_calib.physics.statics import axial_lever, hoop_lever, strains

Array = NDArray[np.float64]

Stress = Callable[[Array], Array]
"""The missing stress at a strain, up to a factor."""
AT_LIMIT = 0.05
"""Least that is left of 1 − (e/e_lim)²: no reading is beyond the limit."""
SHARE = 0.2
"""Prior root mean square of the missing term on the reference grid, as a share of the force scale."""
TESTED, LEAST_TESTED = 40, 0.01
"""Strains of a tensile test that a polynomial was fitted to, and the least that such a test goes up to."""


def _force_of(stress: Stress, shape: Shape, rest: Rest, setting: Setting) -> Array:
    """Force of a stress in both directions (thesis Eq. 4.10)."""
    z, x = strains(shape, rest, setting.simulation.strain)
    return axial_lever(shape) * stress(z) - hoop_lever(shape) * stress(x)


def _term(state: State, values: Values, setting: Setting, stress: Stress | None = None) -> Array:
    """The missing term, N: its root mean square on the grid is ``next_order`` of the force scale."""
    assert state.shape is not None
    stress = stress or _next_power(setting)
    grid = reference_shape(setting.geometry, setting.simulation.kinematics)
    force = _force_of(stress, grid, rest_of(setting.geometry), setting)
    unit = setting.force_scale / np.sqrt(np.mean(force**2, axis=-1, keepdims=True))
    size: Array = values["next_order"] * unit
    return size * _force_of(stress, state.shape, state.rest, setting)


def _next_power(setting: Setting, harder: Stress = np.ones_like) -> Stress:
    """The power M + 1 of the strain, times ``harder`` of it."""
    power = setting.simulation.order + 1
    return lambda strain: np.asarray(strain**power * harder(strain))


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
    return state._replace(lost=state.lost - force)


def _fung(state: State, values: Values, setting: Setting) -> State:
    """The missing term hardens exponentially with the strain; below 0 it softens."""
    stress = _next_power(setting, _exponential(values))
    return _with_the_law(state, setting, _term(state, values, setting, stress))


def _exponential(values: Values) -> Stress:
    return lambda strain: np.asarray(np.exp(np.clip(values["hardening"] * strain, -30.0, 30.0)))


def _fitted(state: State, values: Values, setting: Setting) -> State:
    """What a polynomial of the declared order left of the same term when it was fitted to a tensile test.

    Least squares at even strains of a test that went up to ``tested_strain``.
    """
    hard = _next_power(setting, _exponential(values))
    reach, order = np.maximum(values["tested_strain"], LEAST_TESTED), setting.simulation.order
    unloaded = 0.0 if setting.simulation.strain == "engineering" else 1.0
    tested = unloaded + reach * np.linspace(0.0, 1.0, TESTED + 1)[1:]
    top = unloaded + reach
    Q, R = np.linalg.qr((tested / top)[..., None] ** np.arange(1, order + 1))
    fit = np.linalg.solve(R, np.swapaxes(Q, -1, -2) @ hard(tested)[..., None])[..., 0]

    def left(strain: Array) -> Array:
        found = hard(strain)
        for k in range(order):
            found = found - fit[:, k : k + 1] * (strain / top) ** (k + 1)
        return found

    return _with_the_law(state, setting, _term(state, values, setting, left))


def _tested(setting: Setting) -> tuple[Parameter, ...]:
    rest = rest_of(setting.geometry)
    length = np.maximum(rest.L0 - setting.stroke, SHORTEST * rest.L0)
    _, hoop = strains(SHAPES[setting.simulation.kinematics](length, rest), rest, "engineering")
    median = max(float(hoop[0, 0]), LEAST_TESTED)
    return (
        *_hardening(setting),
        Parameter("tested_strain", LogNormal(median, 0.5), "largest strain of the tensile test", "", ""),
    )


def _hardening(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("hardening", Normal(0.0, 1.5), "exponent of the strain on top of the power", "", ""),)


def _gent(state: State, values: Values, setting: Setting) -> State:
    """The missing term hardens without bound as the strain nears a limit, from both sides alike."""

    def harder(strain: Array) -> Array:
        return np.asarray(1.0 / np.maximum(1.0 - (strain / values["limit_strain"]) ** 2, AT_LIMIT))

    return _with_the_law(state, setting, _term(state, values, setting, _next_power(setting, harder)))


def _limit(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("limit_strain", LogNormal(2.0, 0.5), "strain that the wall cannot reach", "", ""),)


def _steady(state: State, values: Values, setting: Setting) -> State:
    """The missing term is the same at every pressure, whatever the law of the others."""
    force = _term(state, values, setting)
    if setting.simulation.law != "constant":
        force = force * middle_pressure(setting) / setting.top_pressure
    return state._replace(lost=state.lost - force)


def _line(state: State, values: Values, setting: Setting) -> State:
    """The missing modulus has a line of its own in pressure, as the others of a linear law have."""
    force = _term(state, values, setting)
    if setting.simulation.law != "constant":
        share = values["steady_share"]
        pressure = (1.0 - share) * state.readings.pressure + share * middle_pressure(setting)
        force = force * pressure / setting.top_pressure
    return state._replace(lost=state.lost - force)


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
        forms={"line": _line, "fung": _fung, "fitted": _fitted, "gent": _gent, "steady": _steady},
        own={"line": _steady_share, "fung": _hardening, "fitted": _tested, "gent": _limit},
        sources={
            "line": "thesis Eq. 4.7 for the missing modulus: a line of its own in pressure",
            "fung": "exponential hardening (Fung 1967); Ogden 1972 to the same order",
            "fitted": "the same, less a least squares fit of the declared order (thesis Eq. 2.12)",
            "gent": "limiting extensibility, 1/(1 − J/J_m) with J ∝ e² (Gent 1996, doi:10.5254/1.3538357)",
        },
        kinds={"steady": "here by a modulus that is the same at any pressure"},
        bends={"contraction": 4},
        looseness=2.0,
    )
)
