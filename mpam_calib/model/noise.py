"""Sensor noise: white, and a part that is correlated along time for much less than a stroke."""

from __future__ import annotations

from mpam_calib.model.priors import LogNormal, LogUniform, Parameter
from mpam_calib.model.state import Setting

WHITE, CORRELATED, TIME = "noise_sd_N", "noise_corr_sd_N", "noise_corr_time_s"


def white_noise_parameter(setting: Setting) -> Parameter:
    """Standard deviation of one reading: around the declared one, else around 0.3 % of the force scale."""
    if setting.force_sd is not None:
        prior = LogNormal(setting.force_sd, 0.7)
    else:
        prior = LogNormal(0.003 * setting.force_scale, 1.5)
    return Parameter(WHITE, prior, "white noise of one force reading")


def correlated_noise_parameters(
    setting: Setting, stroke_time: float, reading_time: float
) -> tuple[Parameter, ...]:
    """An Ornstein-Uhlenbeck part; its time constant lies between two readings and well below a stroke.

    Shorter it would be white noise, longer it would be structure.
    """
    shortest = 2.0 * reading_time
    median = 0.3 * (setting.force_sd or 0.003 * setting.force_scale)
    return (
        Parameter(CORRELATED, LogNormal(median, 1.0), "noise that lasts for a moment"),
        Parameter(
            TIME, LogUniform(shortest, max(stroke_time / 30.0, 2.0 * shortest)), "how long that moment is"
        ),
    )
