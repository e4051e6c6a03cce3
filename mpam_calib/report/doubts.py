"""What in the data themselves is to be doubted before the fit to them is."""

from __future__ import annotations

from typing import Final

import numpy as np
import pandas as pd

from mpam_calib.report.blocks import Level
from mpam_calib.report.limit import Limit
from mpam_calib.report.numbers import significant
from mpam_calib.report.view import CalibrationView

BELIEVED_SDS: Final = 5.0
"""A fit that pulls by so many sds of a reading above the floor does not believe that it is slack."""
WANDER_BAD: Final = 0.20
"""A stroke whose pressure strays by this share of its level belongs to another ..."""
WANDER_TOP: Final = 0.02
"""... where that is more than this share of the highest: a gauge's noise is no wandering."""
Z90: Final = 1.6449
"""sigmas in half a central 90 % interval"""


def overruled_slack(view: CalibrationView) -> Limit | None:
    """Readings that are said to be slack where the fit, by all the others, clearly pulls."""
    rows = view.readings("loops", "force_map", "blocked_force")
    slack = rows[rows["censored"].fillna(False).astype(bool)]
    if slack.empty:
        return None
    floor = max(float(slack["force_N"].median()), 0.0)
    pull, sd = _foreseen(slack)
    sd = np.hypot(sd, np.nan_to_num(view.reading_noise))
    wrong = pull > floor + BELIEVED_SDS * sd
    if not wrong.any():
        return None
    count = int(wrong.sum())
    levels = sorted(
        set(np.where(slack["kind"] == "blocked_force", slack["pressure_kPa"], slack["level_kPa"])[wrong])
    )
    listed = ", ".join(f"{level:.4g}" for level in levels[:5]) + (" and more" if len(levels) > 5 else "")
    one = count == 1
    words = (
        f"{count} slack reading{'' if one else 's'}, at {listed} kPa, {'is' if one else 'are'} not believed"
    )
    sentence = (
        f"{words}: there the fit pulls with up to {significant(float(pull[wrong].max()), 2)} N. Look whether "
        f"{'it was' if one else 'they were'} slack; if so, the simulation is wrong there."
    )
    return Limit("caution", sentence, words)


def _foreseen(rows: pd.DataFrame) -> tuple[np.ndarray, np.ndarray]:
    """Force and sd (n,), N, of a new reading at each row; nan where it is not known."""
    low, high = (rows[name].to_numpy(dtype=float) for name in ("low_N", "high_N"))
    return (low + high) / 2.0, (high - low) / (2.0 * Z90)


def wandering(view: CalibrationView) -> Limit | None:
    """A level with strokes whose pressure strays so far that they belong to another."""
    top = WANDER_TOP * view.top_level_kPa
    found = zip(view.levels_kPa, view.strays_kPa, strict=bool(view.strays_kPa))
    far = [(level, stray) for level, stray in found if stray > max(WANDER_BAD * level, top)]
    if not far:
        return None
    level, stray = max(far, key=lambda pair: pair[1])
    words = f"strokes at the level {level:.4g} kPa stray from it by up to {stray:.3g} kPa"
    more = f", and {len(far) - 1} more levels do the like" if len(far) > 1 else ""
    sentence = (
        f"S{words[1:]}{more}: strokes of different pressures are taken for one level. Look at "
        "setpoint_kPa and at what was recorded."
    )
    return Limit("bad", sentence, words)


def look_first(view: CalibrationView, level: Level) -> str:
    """What ``check`` asks of the data where the verdict is no yes: stray readings, and if bad, units."""
    if level == "good":
        return ""
    asked = [
        words for words in view.warnings if "far from" in words or (level == "bad" and words.endswith("?"))
    ]
    return f"Look at the data first: {'; '.join(asked[:3])}" if asked else ""
