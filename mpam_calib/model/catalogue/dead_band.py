"""Pressure dead-band: the part of the pressure that does no work (thesis Eq. 2.45)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import middle_pressure, middle_shape, power
from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import LogNormal, Normal, NormalWithin, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.physics.kinematics import SHAPES, SHORTEST

Array = NDArray[np.float64]

OWN_SD = 0.1
"""Prior sd of a dead-band as a share of the top level."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    # Both signs: a gauge that reads low looks like a negative dead-band. A level at which the muscle
    # was seen to pull lies above it.
    # One parameter for both: a dead-band and a gauge's offset are the same in every recording.
    sd = float(np.hypot(setting.pressure_bias_sd, OWN_SD * setting.top_pressure))
    prior = NormalWithin(0.0, sd, -np.inf, setting.pulls_at)
    return (Parameter("P_DB_kPa", prior, "pressure that does no work yet", "thesis Eq. 2.45"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return state._replace(pressure=np.maximum(state.pressure - values["P_DB_kPa"], 0.0))


def _soft(state: State, values: Values, setting: Setting) -> State:
    """A gradual onset: the work lost grows to P_DB as the pressure passes it; none is lost below 0."""
    band = values["P_DB_kPa"]
    lost = band * -np.expm1(-np.maximum(state.pressure, 0.0) / np.maximum(np.abs(band), 1.0))
    return state._replace(pressure=np.maximum(state.pressure - lost, 0.0))


def _power(state: State, values: Values, setting: Setting) -> State:
    """A power of the pressure, P_DB at the middle of the levels: below 0 it closes, 1 is a gauge's gain."""
    lost = values["P_DB_kPa"] * power(state.pressure / middle_pressure(setting), values["dead_band_exponent"])
    return state._replace(pressure=np.maximum(state.pressure - lost, 0.0))


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("dead_band_exponent", Normal(0.0, 0.5), "power of the pressure lost", "textbook", ""),)


def _closing(state: State, values: Values, setting: Setting) -> State:
    """The pressure that opens the bladder fades as higher pressures lay it against the braid."""
    past = (state.pressure - middle_pressure(setting)) / values["closing_kPa"]
    lost = values["P_DB_kPa"] * np.exp(np.clip(-past, -3.0, 3.0))
    return state._replace(pressure=np.maximum(state.pressure - lost, 0.0))


def _over(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.7 * setting.top_pressure, 0.7)
    return (Parameter("closing_kPa", prior, "pressure over which the dead-band closes"),)


def _balloon(state: State, values: Values, setting: Setting) -> State:
    """A bladder blown up to the braid takes the more the wider that is: P_DB at half the stroke."""
    length = np.maximum(state.rest.L0 - state.displacement, SHORTEST * state.rest.L0)
    part = _inflated(SHAPES[state.kinematics](length, state.rest).R, state, values)
    lost = values["P_DB_kPa"] * part / _inflated(middle_shape(state, setting).R, state, values)
    return state._replace(pressure=np.maximum(state.pressure - lost, 0.0))


def _inflated(R: Array, state: State, values: Values) -> Array:
    """1 − λ⁻⁴: the pressure in a thin tube of a neo-Hookean rubber at R = λr, over that at any width."""
    free = state.rest.R0 / (1.0 + np.minimum(values["bladder_gap"], 1.0))
    return np.asarray(-np.expm1(-4.0 * np.log(np.maximum(R / free, 1.0))))


def _gap(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.15, 0.7)
    return (Parameter("bladder_gap", prior, "how much wider the braid is than the bladder", "", ""),)


register(
    Effect(
        id="dead_band",
        stage=Stage.RIG,
        title="Pressure dead-band",
        sentence="the first part of the pressure does no work (or the gauge has a zero offset)",
        told_by="blocked force at low pressures, down to where the muscle stops pulling",
        source="thesis Eq. 2.45; Hocking & Wereley 2013",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        forms={"soft": _soft, "power": _power, "closing": _closing, "balloon": _balloon},
        own={"power": _exponent, "closing": _over, "balloon": _gap},
        sources={
            "power": "textbook: P_DB·(P/P_middle)^m (0: an offset, 1: an error of the gauge's gain)",
            "closing": "elastic threshold of the bladder (cf. Tsagarakis & Caldwell 2000), fading with P",
            "balloon": "inflation of a thin neo-Hookean tube to the braid, ∝ 1 − λ⁻⁴ (Treloar 1975)",
        },
        bends={"pressure": 3},
    )
)
