"""Parameters on axes: scaled to short tick labels, with the scale in the axis label."""

from __future__ import annotations

import math

import numpy as np

from mpam_calib.report.numbers import superscript
from mpam_calib.report.view import CalibrationView


def axis_scale(view: CalibrationView, name: str) -> tuple[float, str]:
    """A factor for the parameter's draws and the axis label that tells it, "b_1 (10⁶ Pa)"."""
    largest = float(np.abs(view.draws[name]).max())
    power = 0
    if largest > 0 and not 1e-2 <= largest < 1e4:
        power = 3 * math.floor(math.log10(largest) / 3)
    unit = " ".join(part for part in (f"10{superscript(power)}" if power else "", view.unit_of(name)) if part)
    return 10.0**-power, f"{name} ({unit})" if unit else name
