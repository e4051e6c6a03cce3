"""Law shape: E_k(P) bends otherwise than the declared law."""

from __future__ import annotations

from dataclasses import replace

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.model.state import Setting, State


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("law_bend", Normal(0.0, 0.3), "departure from the law at the top level", "", ""),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    # The lowest Legendre polynomial over the levels that the declared law does not already hold.
    low, high = float(setting.levels[0]), setting.top_pressure
    x = (2.0 * state.readings.pressure - low - high) / max(high - low, 1.0)
    bend = x if setting.simulation.law == "constant" else 0.5 * (3.0 * x**2 - 1.0)
    return replace(state, wall_gain=state.wall_gain * (1.0 + values["law_bend"] * bend))


register(
    Effect(
        id="law_shape",
        stage=Stage.HISTORY,
        title="Law shape",
        sentence="the bladder's moduli change with pressure otherwise than the declared law",
        source="bladder stress × (1 + bend·Legendre polynomial in pressure)",
        parameters=_parameters,
        apply=_apply,
        bends={"pressure": 2},
    )
)
