"""Whether the readings reach as far as the headline numbers: to the top pressure, to the free contraction."""

from __future__ import annotations

from typing import Final

import pandas as pd

from mpam_calib.report.limit import Limit
from mpam_calib.report.view import CalibrationView

UNSEEN: Final = 0.1
"""Share of the free contraction that readings may end before, and yet come near it."""
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
    if free is not None and bool(free["extrapolated"]) and (told := _unseen(view, free)):
        names.append("free contraction")
        sentences.append(f"{told} at {top}: {CARRIED}")
    if not names:
        return None
    verb = "is" if len(names) == 1 else "are"
    return Limit("caution", " ".join(sentences), f"the {' and the '.join(names)} {verb} extrapolated")


def cut_off(view: CalibrationView) -> Limit | None:
    """The free contraction's band ends where the curves do."""
    free = view.at_level("free_contraction", view.top_level_kPa)
    if not endless(view, free):
        return None
    sentence = (
        "Some of the plausible curves pull wherever they were looked at, up to a contraction of "
        f"{100 * view.curves_end:.3g} %: the upper end of the free contraction's band is where they end."
    )
    return Limit("caution", sentence, "the free contraction's band ends only where the curves end")


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
    rows = view.readings("loops", "force_map", "free_contraction")
    furthest = rows.loc[rows["level_kPa"] == view.top_level_kPa, "contraction"].max()
    if furthest >= (1.0 - UNSEEN) * free["mean"]:
        return ""
    if pd.isna(furthest) or furthest <= 0.0:
        return "No reading comes near the free contraction"
    return f"The readings go to {100 * furthest / free['mean']:.0f} % of the free contraction"


def endless(view: CalibrationView, free: pd.Series | None) -> bool:
    """Whether a free contraction's band ends where the curves do, some of which have no root."""
    return free is not None and bool(free["q95"] >= view.curves_end - 1e-9)
