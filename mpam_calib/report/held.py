"""Whether bands hold the readings: along the stroke, near full length, at levels left out."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mpam_calib.report.limit import Limit
from mpam_calib.report.view import CalibrationView

HELD: Final = 0.80
"""Least share of readings in bands that should hold 90 % of them ..."""
HELD_READINGS: Final = 20
"""... where there are so many; of fewer a fifth may lie outside by chance."""
NEAR: Final = 0.02
"""Contraction up to which readings lie near full length, where the blocked force is read."""
UNSETTLED: Final = frozenset({"stress_softening", "creep", "force_drift", "rate_friction", "presliding"})
"""Effects that the bands, which are a settled muscle's, leave out where the readings show them."""


def along_stroke(view: CalibrationView) -> Limit | None:
    """At the recorded pressures themselves the bands miss their readings."""
    share = held_along(view)
    if share is None or share >= HELD:
        return None
    words = f"at the recorded pressures the bands hold {100 * share:.0f} % of their readings"
    sentence = (
        f"A{words[1:]}, where they should hold 90 %: the muscle does something that neither the simulation "
        "nor its bands know. Run diagnose, which looks for the cause."
    )
    return Limit("caution", sentence, words)


def full_length(view: CalibrationView) -> Limit | None:
    """Readings near full length miss their bands: so does the blocked force."""
    share = held_near(view)
    if share is None or share >= HELD:
        return None
    sentence = (
        f"Do not take the blocked force at its band: near full length {100 * share:.0f} % of the readings "
        "lie in bands that should hold 90 % of them. The command diagnose looks for the cause."
    )
    return Limit("caution", sentence, "near full length the bands miss their readings")


def between_levels(view: CalibrationView) -> Limit | None:
    """The inner levels, predicted from the others, miss their readings: so it is anywhere between levels."""
    share = held_between(view)
    if share is None or share >= HELD:
        return None
    recorded = along_stroke(view) is None
    advice = (
        "Use these numbers at the recorded pressures only" if recorded else "Do not interpolate in pressure"
    )
    sentence = (
        f"{advice}: a level between others, predicted from them, has "
        f"{100 * share:.0f} % of its readings inside bands that should hold 90 % of them."
    )
    return Limit("caution", sentence, "between the recorded pressures the bands are too narrow")


def beyond_levels(view: CalibrationView) -> Limit | None:
    """The outer levels, predicted from the others, miss their readings."""
    share = _held_left_out(view, extrapolated=True)
    if share is None or share >= HELD:
        return None
    sentence = (
        "Do not extrapolate in pressure: the lowest and the highest level, predicted from the others, have "
        f"{100 * share:.0f} % of their readings inside bands that should hold 90 % of them."
    )
    return Limit("good", sentence, "beyond the recorded pressures the bands are too narrow")


def held_between(view: CalibrationView) -> float | None:
    """Share of the inner levels' readings in the 90 % bands that the others give; None where they are few."""
    return _held_left_out(view, extrapolated=False)


def _held_left_out(view: CalibrationView, extrapolated: bool) -> float | None:
    rows = view.left_out
    if rows.empty:
        return None
    rows = rows[rows["extrapolated"].astype(bool) == extrapolated]
    return float(rows["inside90"].mean()) if rows["readings"].sum() >= HELD_READINGS else None


def held_along(view: CalibrationView) -> float | None:
    """Share of all readings of the stroke in the 90 % bands of new ones; None where it says nothing."""
    return _held_up_to(view, math.inf)


def held_near(view: CalibrationView) -> float | None:
    """Share of the readings near full length in the 90 % bands of new ones; None where it says nothing."""
    return _held_up_to(view, NEAR)


def _held_up_to(view: CalibrationView, contraction: float) -> float | None:
    """None where readings are few, or where a declared effect sets them apart from a settled muscle."""
    rows = view.readings("loops", "force_map")
    rows = rows[(rows["contraction"] <= contraction) & ~rows["censored"].astype(bool)]
    bands = view.quantity("force_N_observed")
    declared = {effect.split(":")[0] for effect in view.simulation.effects}
    if bands.empty or UNSETTLED & declared:
        return None
    inside = []
    for (level, branch), here in rows.groupby(["level_kPa", "branch"]):
        band = bands[(bands["pressure_kPa"] == level) & (bands["branch"] == (branch or "mean"))]
        # Past the free contraction there is no band.
        here = here[here["contraction"] <= band["contraction"].max()]
        if not here.empty:
            low, high = (np.interp(here["contraction"], band["contraction"], band[q]) for q in ("q05", "q95"))
            inside.append((here["force_N"] >= low) & (here["force_N"] <= high))
    held = np.concatenate(inside) if inside else np.zeros(0, dtype=bool)
    return float(held.mean()) if len(held) >= HELD_READINGS else None
