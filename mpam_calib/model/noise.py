"""Sensor noise: white, and a part that is correlated along time for much less than a stroke.

Where the declaration allows it, all of it grows with the force, sd(F) = sd·√(1 + (g F/force scale)²), and
the white part of a bin (or of a point) is Student-t: its sd is then the scale of that distribution.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.priors import HalfNormal, LogNormal, LogUniform, Parameter
from mpam_calib.model.state import Setting
from mpam_calib.specimen.declaration import Noise

Array = NDArray[np.float64]

WHITE, CORRELATED, TIME = "noise_sd_N", "noise_corr_sd_N", "noise_corr_time_s"
GROWTH, FREEDOM = "noise_growth", "noise_dof"
SHORTEST = 2.0
"""Readings that correlated noise lasts at the least: shorter it would be white."""
NOISELESS = 1e-5
"""Least noise as a share of the force scale: computed readings have none, and would weigh without bound."""


def white_noise_prior(force_sd: float | None, force_scale: float) -> LogNormal:
    """Of one reading's sd (N): around the declared one, else around 0.3 % of the force scale."""
    least = NOISELESS * force_scale
    if force_sd is None:
        return LogNormal(0.003 * force_scale, 1.5, least)
    return LogNormal(force_sd, 0.7, min(least, 0.1 * force_sd))


def white_noise_parameter(setting: Setting) -> Parameter:
    """Standard deviation of one reading."""
    prior = white_noise_prior(setting.force_sd, setting.force_scale)
    return Parameter(WHITE, prior, "white noise, new in every reading, one sigma")


def correlated_noise_parameters(
    setting: Setting, stroke_time: float, reading_time: float
) -> tuple[Parameter, ...]:
    """An Ornstein-Uhlenbeck part; its time constant lies between two readings and well below a stroke.

    Longer it would be structure.
    """
    shortest = SHORTEST * reading_time
    median = 0.3 * (setting.force_sd or 0.003 * setting.force_scale)
    return (
        Parameter(CORRELATED, LogNormal(median, 1.0), "noise that lasts over several readings, one sigma"),
        Parameter(
            TIME, LogUniform(shortest, max(stroke_time / 30.0, 2.0 * shortest)), "how long such noise lasts"
        ),
    )


def declared_noise_parameters(noise: Noise) -> tuple[Parameter, ...]:
    """What ``[noise]`` adds: growth g (at 1 the noise is √2-fold at the force scale), degrees of freedom."""
    found = []
    if noise.growth:
        found.append(Parameter(GROWTH, HalfNormal(3.0), "how the noise grows with the force", "", ""))
    if noise.robust:
        found.append(
            Parameter(FREEDOM, LogNormal(20.0, 1.0), "degrees of freedom of the white noise", "", "")
        )
    return tuple(found)


def grown(growth: Array, force: Array, force_scale: float) -> Array:
    """Factor √(1 + (g F/force scale)²) on the noise at a force (N); arrays broadcast."""
    return np.asarray(np.sqrt(1.0 + (growth * force / force_scale) ** 2))
