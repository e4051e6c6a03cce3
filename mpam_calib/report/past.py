"""Whether the readings are those of the settled muscle, of which all bands are."""

from __future__ import annotations

from typing import Final

from mpam_calib.model.effect import Stage, effect
from mpam_calib.report.limit import Limit
from mpam_calib.report.numbers import significant
from mpam_calib.report.view import CalibrationView

SHARE: Final = 0.005
"""Share of the blocked force from which on it is worth saying that readings lie off the settled muscle's."""
SETTLED: Final = "after many cycles, just after the pressure was reached"


def past(view: CalibrationView) -> Limit | None:
    """The readings at the top level lie off the headline's state by more than its band."""
    blocked = view.at_level("blocked_force_N", view.top_level_kPa)
    if blocked is None:
        return None
    off = _off(view)
    half = (float(blocked["q95"]) - float(blocked["q05"])) / 2.0
    if abs(off) <= max(half, SHARE * abs(float(blocked["mean"]))):
        return None
    lie = f"lie {significant(abs(off), 2)} N {'above' if off > 0.0 else 'below'}"
    readings = f"the readings of this test at {view.top_level_kPa:.4g} kPa"
    stages = {effect(name).stage for name in view.simulation.effects}
    if Stage.SENSOR in stages and Stage.HISTORY not in stages:
        brief = f"{readings} {lie} on average for a load cell that wandered"
        return Limit("good", f"T{brief[1:]}: these numbers are without that.", brief)
    sentence = (
        f"These numbers are of the settled muscle ({SETTLED}). On average {readings} {lie}, for the cycles "
        "and times at which they were taken: so will what you measure at such times."
    )
    return Limit("caution", sentence, f"they are of the settled muscle, and {readings} {lie}")


def off_bands(view: CalibrationView) -> str:
    """What a figure of bands beside readings has to say of that; "" where they are of one state."""
    if past(view) is None:
        return ""
    return f" Bands are of the settled muscle ({SETTLED}); readings lie off them by what the test had done."


def _off(view: CalibrationView) -> float:
    """Mean (N) over the top level's readings that are not slack, each branch as much as the other."""
    rows = view.readings("loops")
    rows = rows[(rows["level_kPa"] == view.top_level_kPa) & ~rows["censored"].fillna(False).astype(bool)]
    return 0.0 if rows.empty else float(rows.groupby("branch")["past_N"].mean().mean())
