"""Whether bands hold the readings: along the stroke, near full length, at levels left out."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import pandas as pd

from mpam_calib.report.limit import Limit
from mpam_calib.report.view import CalibrationView

HELD: Final = 0.80
"""Least share of readings in bands that should hold 90 % of them ..."""
CHANCE: Final = 0.01
"""... which is an alarm where so few would lie in them by chance less often than this."""
HELD_READINGS: Final = 20
"""Of fewer readings nothing is said."""
NEAR: Final = 0.02
"""Contraction up to which readings lie near full length, where the blocked force is read."""
UNSETTLED: Final = frozenset({"stress_softening", "creep", "force_drift", "rate_friction", "presliding"})
"""Effects that the bands, which are a settled muscle's, leave out where the readings show them."""


@dataclass(frozen=True)
class Held:
    """How many of so many readings lie in bands that should hold 90 % of them."""

    readings: float
    share: float

    @property
    def enough(self) -> bool:
        """Whether there is nothing to remark."""
        return self.share >= HELD

    @property
    def missed(self) -> bool:
        """Whether too few do for it to be chance."""
        from scipy.stats import binom

        by_chance = binom.cdf(round(self.share * self.readings), round(self.readings), 0.9)
        return not self.enough and bool(by_chance < CHANCE)

    def __str__(self) -> str:
        return f"{100 * self.share:.0f} %"


def along_stroke(view: CalibrationView) -> Limit | None:
    """At the recorded pressures themselves the bands miss their readings."""
    held = held_along(view)
    if held is None or not held.missed:
        return None
    words = f"at the recorded pressures the bands hold {held} of their readings"
    sentence = (
        f"A{words[1:]}, where they should hold 90 %: the muscle does something that neither the simulation "
        "nor its bands know. Run diagnose, which looks for the cause."
    )
    return Limit("caution", sentence, words)


def full_length(view: CalibrationView) -> Limit | None:
    """Readings near full length miss their bands: so does the blocked force."""
    held = held_near(view)
    if held is None or not held.missed:
        return None
    sentence = (
        f"Do not take the blocked force at its band: near full length {held} of the readings "
        "lie in bands that should hold 90 % of them. The command diagnose looks for the cause."
    )
    return Limit("caution", sentence, "near full length the bands miss their readings")


def between_levels(view: CalibrationView) -> Limit | None:
    """The inner levels, predicted from the others, miss their readings: so it is anywhere between levels."""
    held = held_between(view)
    if held is None or not held.missed:
        return None
    recorded = along_stroke(view) is None
    advice = (
        "Use these numbers at the recorded pressures only" if recorded else "Do not interpolate in pressure"
    )
    sentence = (
        f"{advice}: a level between others, predicted from them, has "
        f"{held} of its readings inside bands that should hold 90 % of them."
    )
    return Limit("caution", sentence, "between the recorded pressures the bands are too narrow")


def beyond_levels(view: CalibrationView) -> Limit | None:
    """The outer levels, predicted from the others, miss their readings."""
    held = held_left_out(view.left_out, extrapolated=True)
    if held is None or not held.missed:
        return None
    sentence = (
        "Do not extrapolate in pressure: the lowest and the highest level, predicted from the others, have "
        f"{held} of their readings inside bands that should hold 90 % of them."
    )
    return Limit("good", sentence, "beyond the recorded pressures the bands are too narrow")


def held_between(view: CalibrationView) -> Held | None:
    """The inner levels' readings in the 90 % bands that the others give; None where they are few."""
    return held_left_out(view.left_out, extrapolated=False)


def held_left_out(rows: pd.DataFrame, extrapolated: bool) -> Held | None:
    """The inner levels, or the outer ones, of a view's ``left_out``; None where their readings are few."""
    if rows.empty:
        return None
    rows = rows[rows["extrapolated"].astype(bool) == extrapolated]
    readings = rows["readings"].sum()
    return _held((rows["inside90"] * rows["readings"]).sum() / max(readings, 1), readings)


def held_along(view: CalibrationView) -> Held | None:
    """All readings of the stroke in the 90 % bands of new ones; None where they say nothing."""
    return _held_up_to(view, math.inf)


def held_near(view: CalibrationView) -> Held | None:
    """The readings near full length in the 90 % bands of new ones; None where they say nothing."""
    return _held_up_to(view, NEAR)


def _held_up_to(view: CalibrationView, contraction: float) -> Held | None:
    """None where readings are few, or where a declared effect sets them apart from a settled muscle."""
    rows = view.readings("loops", "force_map")
    rows = rows[(rows["contraction"] <= contraction) & ~rows["censored"].astype(bool)]
    declared = {effect.split(":")[0] for effect in view.simulation.effects}
    if UNSETTLED & declared:
        return None
    # Past the free contraction there is no band.
    rows = rows[rows["contraction"] <= rows["level_kPa"].map(_band_ends(view))]
    # At each reading's own pressure: that of its level is another where a regulator is slow.
    rows = rows.dropna(subset=["low_N", "high_N"])
    return _held(rows["force_N"].between(rows["low_N"], rows["high_N"]).mean(), len(rows))


def _band_ends(view: CalibrationView) -> pd.Series:
    """The largest contraction in the bands of each level, by its pressure."""
    ends: pd.Series = view.quantity("force_N").groupby("pressure_kPa")["contraction"].max()
    return ends


def _held(share: float, readings: float) -> Held | None:
    return Held(float(readings), float(share)) if readings >= HELD_READINGS else None
