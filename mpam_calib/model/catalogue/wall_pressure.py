"""Wall pressure: how much of the wall's thickness term is really there."""

from __future__ import annotations

from mpam_calib.model.curves import middle_pressure, middle_shape, power, settled
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, Normal, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (
        Parameter(
            "wall_factor", Normal(0.0, 1.0), "share of the wall's pressure term that is missing", "", ""
        ),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    return state._replace(wall_factor=state.wall_factor * (1.0 - values["wall_factor"]))


def _thick(state: State, values: Values, setting: Setting) -> State:
    """A thick wall carries more of it than a thin one: the share goes with a power of t/R."""
    assert state.shape is not None
    middle = middle_shape(state, setting)
    ratio = (state.shape.t / state.shape.R) / (middle.t / middle.R)
    share = values["wall_factor"] * power(ratio, values["thickness_exponent"])
    return _apply(state, {**values, "wall_factor": share}, setting)


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("thickness_exponent", LogNormal(1.0, 0.4), "power of thickness over radius", "", ""),)


def _pressed(state: State, values: Values, setting: Setting) -> State:
    """A wall pressed against the braid takes part the more, or the less, by a power of the pressure."""
    part = power(state.pressure / middle_pressure(setting), values["wall_exponent"])
    return _apply(state, {**values, "wall_factor": values["wall_factor"] * part}, setting)


def _pressure_exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("wall_exponent", Normal(0.0, 0.5), "power of the pressure", "textbook", ""),)


def _seated(state: State, values: Values, setting: Setting) -> State:
    """A wall that hands its pressure on to the braid as it seats against it."""
    part = settled(state.pressure, values["seating_kPa"], middle_pressure(setting))
    return _apply(state, {**values, "wall_factor": values["wall_factor"] * part}, setting)


def _seating(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.5 * middle_pressure(setting), 0.7)
    return (Parameter("seating_kPa", prior, "pressure over which the wall seats"),)


register(
    Effect(
        id="wall_pressure",
        stage=Stage.STATICS,
        title="Wall pressure",
        sentence="the wall carries the pressure through its thickness, so it costs less force than declared",
        told_by="a second muscle with a thinner wall",
        source="thesis Eq. 2.9 (force balance, factor 0) against virtual work (factor 1)",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={"thick": _thick, "pressed": _pressed, "seated": _seated},
        own={"thick": _exponent, "pressed": _pressure_exponent, "seated": _seating},
        sources={
            "thick": "thick-walled cylinder: the stress's fall across the wall ∝ t/R (Lamé 1852)",
            "pressed": "textbook: a share that goes with a power of the pressure, f·(P/P_middle)^m",
            "seated": "textbook: a share that settles as the wall seats, 1 − exp(−P/P_seat)",
        },
        bends={"contraction": 2, "pressure": 2},
    )
)
