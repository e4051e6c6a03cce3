"""Whether the readings reach as far as the headline numbers: to the top pressure, to the free contraction."""

from __future__ import annotations

from typing import Final

import pandas as pd

from mpam_calib.report.limit import Limit
from mpam_calib.report.numbers import with_band, with_open_end
from mpam_calib.report.view import CalibrationView

UNSEEN: Final = 0.1
"""Share of the free contraction that readings may end before, and yet come near it."""
AT_LEVEL: Final = 0.01
"""Share of a level by which a free contraction's own pressure may differ from it."""
MOST: Final = ("all", "most")
"""Of the curves without a free contraction: where it is these, there is none to be stated."""
CARRIED: Final = "the simulation carries the number there, not the data."


def extrapolation(view: CalibrationView) -> Limit | None:
    """A headline number lies outside the readings."""
    if view.tensile:
        return None
    top = f"{view.top_level_kPa:.4g} kPa"
    names, sentences = [], []
    blocked = view.at_level("blocked_force_N", view.top_level_kPa)
    if blocked is not None and bool(blocked["extrapolated"]):
        names.append("blocked force")
        sentences.append(f"No reading comes near the blocked force at {top}: {CARRIED}")
    free = view.at_level("free_contraction", view.top_level_kPa)
    stated = free is not None and still_pulling(view, free) not in MOST
    if free is not None and stated and bool(free["extrapolated"]) and (told := _unseen(view, free)):
        names.append("free contraction")
        sentences.append(f"{told} at {top}: {CARRIED}")
    if not names:
        return None
    verb = "is" if len(names) == 1 else "are"
    return Limit("caution", " ".join(sentences), f"the {' and the '.join(names)} {verb} extrapolated")


def cut_off(view: CalibrationView) -> Limit | None:
    """The free contraction, or its band's upper end, lies beyond the curves."""
    free = view.at_level("free_contraction", view.top_level_kPa)
    if not (which := still_pulling(view, free)):
        return None
    end = f"{100 * view.curves_end:.3g} %"
    pull = (
        f"{which.capitalize()} of the plausible curves pull wherever they were looked at, up to a contraction"
    )
    if which in MOST:
        sentence = f"{pull} of {end}: there is no free contraction to be stated."
        return Limit("caution", sentence, f"the muscle still pulls at a contraction of {end}")
    sentence = f"{pull} of {end}: the free contraction's band has no upper end."
    return Limit("caution", sentence, "the free contraction's band has no upper end")


def between_ends(view: CalibrationView) -> Limit | None:
    """No force was read between full length and the free contraction, which was.

    A free contraction enters by the curve's slope there, which other readings must tell: without them the
    bands between the ends were found to hold as little as 4 % of the true forces.
    """
    if view.readings("free_contraction").empty or not view.readings("loops", "force_map").empty:
        return None
    sentence = (
        "Do not take a force between full length and the free contraction from these bands: none was read "
        "there, the curve is the simulation's, and its bands can be far too narrow. Loops or a force map "
        "would tell it."
    )
    return Limit("caution", sentence, "no force was read between the curve's ends")


def _unseen(view: CalibrationView, free: pd.Series) -> str:
    """That the readings at the top level end far before its free contraction, if they do."""
    top = view.top_level_kPa
    rows = view.readings("loops", "force_map", "free_contraction")
    rows = rows[rows["level_kPa"] == top]
    # The level nearest to a free contraction's own pressure may be far from it.
    elsewhere = (rows["kind"] == "free_contraction") & ((rows["pressure_kPa"] - top).abs() > AT_LEVEL * top)
    furthest = rows.loc[~elsewhere, "contraction"].max()
    if furthest >= (1.0 - UNSEEN) * free["mean"]:
        return ""
    if pd.isna(furthest) or furthest <= 0.0:
        return "No reading comes near the free contraction"
    return f"The readings go to {100 * furthest / free['mean']:.0f} % of the free contraction"


def still_pulling(view: CalibrationView, free: pd.Series | None) -> str:
    """Which of the curves have no free contraction, as they pull to their end: "" where hardly any.

    A curve without a root counts with its end, so that a mean there is that of such curves alone.
    """
    if free is None:
        return ""
    ends = (("mean", "all"), ("q50", "most"), ("q95", "some"))
    return next((which for column, which in ends if free[column] >= view.curves_end - 1e-9), "")


def contraction_band(view: CalibrationView, free: pd.Series) -> tuple[str, str]:
    """A free contraction and its 90 % band as printed, in percent; what was not found has no value."""
    which = still_pulling(view, free)
    mean, low, high, median = (100.0 * float(free[q]) for q in ("mean", "q05", "q95", "q50"))
    if not which:
        return with_band(mean, low, high, median)
    value, band = with_open_end(mean, low, high, median)
    if which not in MOST:
        return value, band
    return f"still pulls at {high:.3g}", band if low < high - 1e-7 else "–"
