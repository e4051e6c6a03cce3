"""Measured free contractions beside those of the curve."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from mpam_calib.report.limit import Limit
from mpam_calib.report.numbers import significant
from mpam_calib.report.view import CalibrationView

MISS: Final = 0.03
"""Share of the free contraction by which readings may miss the curve (root mean square) ..."""
TOGETHER: Final = 2.0
"""... or by more, where the misses are no more than so many times what single readings scatter by ..."""
READ_SD: Final = 0.003
"""... of which this is the least, and all that is taken for noise ..."""
FEW: Final = 4
"""... of fewer readings than these, which do not tell their scatter."""
_SD: Final = 0.6745 * 2.0**0.5
"""Median size of a difference between two readings, in sds of one."""


def free_read(view: CalibrationView) -> Limit | None:
    """The measured free contractions contradict the curve, and their own noise has taken that up."""
    rows = view.readings("free_contraction")
    rows = rows[~rows["censored"].fillna(False).astype(bool)].dropna(subset=["low_N", "high_N"])
    if rows.empty:
        return None
    rows = rows.assign(curve=(rows["low_N"] + rows["high_N"]) / 2.0).sort_values(
        "pressure_kPa", kind="stable"
    )
    rows = rows.assign(miss=rows["contraction"] - rows["curve"])
    size = _size(rows["miss"])
    if size <= MISS * _size(rows["curve"]) or size <= TOGETHER * _scatter(rows["miss"]):
        return None
    columns = ["pressure_kPa", "contraction", "curve", "miss", "low_N", "high_N"]
    levels = rows.groupby("level_kPa")[columns].mean()
    levels = levels[~levels["contraction"].between(levels["low_N"], levels["high_N"])]
    if levels.empty:
        return None
    return _told(view, levels.iloc[int(levels["miss"].abs().to_numpy().argmax())])


def early_roots(view: CalibrationView) -> Limit | None:
    """Draws whose force is gone well short of a measured free contraction, too many to leave them out."""
    if not view.early_roots > 0.0:
        return None
    words = "the simulation contradicts a measured free contraction"
    sentence = (
        f"In {100.0 * view.early_roots:.0f} % of the draws the force is gone well short of a measured free "
        "contraction: this simulation and these data contradict each other."
    )
    return Limit("caution", sentence, words)


def _told(view: CalibrationView, level: pd.Series) -> Limit:
    """The measured value and the curve's side by side, at the level where they differ most."""
    read, curve = (f"{significant(100.0 * level[name], 3)} %" for name in ("contraction", "curve"))
    if level["high_N"] >= view.curves_end - 1e-9:
        curve = f"at least {curve}"
    at = f"{level['pressure_kPa']:.4g} kPa"
    sentence = (
        f"Do not take the free contraction at its band: at {at} {read} was measured, and the curve has "
        f"{curve}. Look at how it was measured; if that is right, the simulation is wrong there."
    )
    words = f"the measured free contractions ({read} at {at}) contradict the curve ({curve})"
    return Limit("caution", sentence, words)


def _size(values: pd.Series) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _scatter(misses: pd.Series) -> float:
    """What one reading differs by from the next in pressure, as a sd."""
    if len(misses) < FEW:
        return READ_SD
    return max(float(misses.diff().abs().median()) / _SD, READ_SD)
