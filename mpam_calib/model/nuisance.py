"""Declared uncertainties of geometry and gauge: parameters that widen the bands."""

from __future__ import annotations

import numpy as np

from mpam_calib.model.effect import Values
from mpam_calib.model.priors import Normal, NormalWithin, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.units import si_factor

GEOMETRY = {"L0_mm": "L0", "R0_mm": "R0", "t0_mm": "t0", "alpha0_deg": "alpha0"}
MEANINGS = {
    "L0_mm": "length at rest",
    "R0_mm": "outer radius at rest",
    "t0_mm": "wall thickness at rest",
    "alpha0_deg": "braid angle at rest",
}
HIGHEST = {"alpha0_deg": 0.5 * np.pi}
"""SI; all geometry lies above 0."""
FAR = 8.0
"""Standard deviations from which on a bound does not count."""
BIAS = "pressure_bias_kPa"


def nuisance_parameters(setting: Setting) -> tuple[Parameter, ...]:
    """One parameter for each declared sd above zero: the geometry's values, the gauge's offset."""
    parameters = []
    for name, attribute in GEOMETRY.items():
        sd = getattr(setting.geometry.sd, name) * si_factor(name)
        matching = name == "alpha0_deg" and "braid_angle" in setting.simulation.effect_ids
        if sd > 0.0 and not matching:
            prior = _possible(getattr(setting.geometry, attribute), sd, HIGHEST.get(name, np.inf))
            parameters.append(Parameter(name, prior, MEANINGS[name], "specimen.toml"))
    if setting.pressure_bias_sd > 0.0 and "dead_band" not in setting.simulation.effect_ids:
        # A level at which the muscle was seen to pull had some pressure.
        bias = NormalWithin(0.0, setting.pressure_bias_sd, -setting.pulls_at, np.inf)
        parameters.append(Parameter(BIAS, bias, "true pressure minus the gauge's reading", "specimen.toml"))
    return tuple(parameters)


def _possible(value: float, sd: float, highest: float) -> Normal | NormalWithin:
    """What was measured, given that the geometry exists."""
    if min(value, highest - value) > FAR * sd:
        return Normal(value, sd)
    return NormalWithin(value, sd, 0.0, highest)


def apply_nuisances(state: State, values: Values) -> State:
    """Put the sampled geometry and gauge offset in place of the declared ones."""
    changed = {attribute: values[name] for name, attribute in GEOMETRY.items() if name in values}
    # A sampled wall must stay inside its tube, or no shape exists.
    rest = state.rest._replace(**changed)
    rest = rest._replace(t0=np.minimum(rest.t0, 0.999 * rest.R0))
    state = state._replace(rest=rest)
    if BIAS in values:
        state = state._replace(pressure=np.maximum(state.pressure + values[BIAS], 0.0))
    return state
