"""What the pressure gauge's constant offset does to the numbers: as declared, or as the fit found it."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.model.nuisance import BIAS
from mpam_calib.report.doubts import Z90
from mpam_calib.report.limit import Limit
from mpam_calib.report.numbers import significant, with_band
from mpam_calib.report.view import CalibrationView

Array = NDArray[np.float64]

SHARE: Final = 0.5
"""The gauge limits the result when its offset makes up this share of the band ..."""
TAKEN_UP: Final = 2.0
"""... and where it would make up this many of the band, free parameters have taken up the offset."""
LEARNT: Final = 0.5
"""An offset is found where the fit leaves at most this share of its declared sd, and its sign is known."""
AS_READ: Final = "the bands hold for pressures as this gauge reads them"


def gauge(view: CalibrationView) -> Limit | None:
    """The gauge's offset makes up most of the band, or moves forces by much beside it."""
    if view.tensile or view.pressure_bias_sd_kPa <= 0:
        return None
    rows = view.quantity("blocked_force_N")
    rows = rows[rows["pressure_kPa"] <= view.top_level_kPa * (1 + 1e-9)]
    if rows.empty:
        return None
    half = float(rows["q95"].iloc[-1] - rows["q05"].iloc[-1]) / 2.0
    if half <= 0:
        return None
    slope = _slope(rows["pressure_kPa"].to_numpy(), rows["mean"].to_numpy())
    declared, offset = view.pressure_bias_sd_kPa, _sampled(view)
    if offset is None:
        return _open(-Z90 * declared * slope, Z90 * declared * slope, half, f"{declared:g}")
    low, high = -slope * float(offset["q95"]), -slope * float(offset["q05"])
    learnt = offset["sd"] <= LEARNT * declared
    if learnt and low * high > 0.0:
        return _found(offset, slope, half)
    if learnt and high - low <= 2.0 * TAKEN_UP * half:
        return _narrowed(offset, (high - low) / 2.0, half)
    return _open(low, high, half, f"{declared:g} and the readings")


def _slope(pressure: Array, force: Array) -> float:
    """Of the blocked force (N/kPa) at the highest pressure; of one level, that of a line through zero."""
    P, F = np.append(0.0, pressure), np.append(0.0, force)
    return abs(float(F[-1] - F[-2]) / float(P[-1] - P[-2])) if P[-1] > P[-2] else 0.0


def _sampled(view: CalibrationView) -> pd.Series | None:
    """The offset's row of the summary (true pressure minus reading, kPa), where the run has sampled it."""
    rows = view.summary[view.summary["parameter"] == BIAS]
    return None if rows.empty else rows.iloc[0]


def _open(low: float, high: float, half: float, by: str) -> Limit | None:
    """An offset that nobody knows: by a true gauge forces differ by ``low`` to ``high`` (N, 90 %)."""
    newtons = (high - low) / 2.0
    if newtons < SHARE * half:
        return None
    size = f"± {significant(newtons, 2)}"
    why = f"(90 %, by pressure_bias_sd_kPa = {by})"
    if newtons > TAKEN_UP * half:
        even = abs(low + high) < 0.1 * newtons
        range_ = size if even else f"{significant(low, 2)} to {significant(high, 2)}"
        sentence = (
            "The bands hold for pressures as this gauge reads them: whatever constant offset it has, the fit "
            f"has made up for it. By a gauge that has none, forces may differ by {range_} N {why} more."
        )
        return Limit("good", sentence, AS_READ)
    sentence = (
        f"The pressure gauge sets the width of the band: its offset alone is worth {size} N {why}. More "
        "loops do not help; a better gauge does."
    )
    return Limit("good", sentence, "the pressure gauge sets the width of the band")


def _narrowed(offset: pd.Series, newtons: float, half: float) -> Limit | None:
    """An offset about zero that the readings have told: it is worth ± ``newtons`` (90 %)."""
    if newtons < SHARE * half:
        return None
    size = f"± {significant(float(offset['q95'] - offset['q05']) / 2.0, 2)} kPa"
    sentence = (
        f"By these readings the pressure gauge's offset is known to {size} (90 %), worth "
        f"± {significant(newtons, 2)} N: more readings narrow it, and so does a gauge that is known better."
    )
    return Limit("good", sentence, f"the pressure gauge's offset is known to {size} only")


def _found(offset: pd.Series, slope: float, half: float) -> Limit | None:
    """An offset that the fit knows: by a true gauge forces differ by a known amount.

    ``slope`` (N/kPa) is that of the blocked force at the top level, ``half`` (N) half its band.
    """
    mean, *ends = (abs(float(offset[q])) for q in ("mean", "q05", "q95"))
    if slope * mean < SHARE * half:
        return None
    value, band = with_band(mean, *sorted(ends))
    # A gauge that reads too much stands at less true pressure than a true one at the same reading.
    reads, way = ("too much", "higher") if offset["mean"] < 0.0 else ("too little", "lower")
    sentence = (
        f"The bands hold for pressures as this gauge reads them. By the fit it reads {value} kPa {reads} "
        f"(90 % band {band} kPa), unless the muscle has a dead-band, which looks the same. By a gauge that "
        f"has no offset the blocked force at the top level is about {significant(slope * mean, 2)} N {way}."
    )
    return Limit("good", sentence, AS_READ)
