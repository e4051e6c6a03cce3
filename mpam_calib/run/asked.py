"""What bands are worth at pressures that ``predict`` is asked for: between the recorded ones, or beyond."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.prediction.curves import Reach, contraction_grid
from mpam_calib.prediction.recorded import Recorded
from mpam_calib.report.held import Held, held_left_out
from mpam_calib.units import KPA

Array = NDArray[np.float64]

LEFT_OUT = "left_out"
"""The key of ``run.json`` that keeps what became of each level that was left out."""
KEPT = ("pressure_kPa", "readings", "inside90", "extrapolated")
EVERYTHING = ": these numbers are extrapolated"
BUT_BLOCKED = " of all but the blocked force, which alone is not extrapolated there"
"""What ends a line on pressures beyond the levels, by what was recorded at them."""
SHOWN = 4
"""Pressures that a line names."""


def kept_left_out(rows: pd.DataFrame) -> list[dict[str, float | bool]]:
    """The levels left out as ``run.json`` keeps them, so that later commands need not do that work again."""
    return [
        {
            "pressure_kPa": round(float(row["pressure_kPa"]), 3),
            "readings": int(row["readings"]),
            "inside90": round(float(row["inside90"]), 6),
            "extrapolated": bool(row["extrapolated"]),
        }
        for row in rows.to_dict("records")
    ]


def remarks(model: Model, state: dict[str, Any], pressures_kPa: Array, table: pd.DataFrame) -> list[str]:
    """What to know before using predictions at pressures (kPa), a line for each kind; often nothing.

    ``state`` is the content of ``run.json``, which an older version may have written.
    """
    reach = Reach.of(model.blueprint)
    outside, between = reach.outside(pressures_kPa * KPA), reach.between(pressures_kPa * KPA)
    rows = pd.DataFrame(state.get(LEFT_OUT) or [], columns=list(KEPT))
    recorded = Recorded.kept(state)
    blocked = np.zeros_like(outside) if recorded is None else recorded.blocked(pressures_kPa * KPA)
    levels, held = reach.pressures / KPA, held_left_out(rows, extrapolated=True)
    lines = [
        _between(pressures_kPa[between], held_left_out(rows, extrapolated=False)),
        _beyond(pressures_kPa[outside & ~blocked], levels, held),
        _beyond(pressures_kPa[outside & blocked], levels, held, BUT_BLOCKED),
        _cut(float(contraction_grid(model, float(reach.contraction.max()))[-1]), table),
    ]
    return [line for line in lines if line]


def _between(pressures: Array, held: Held | None) -> str:
    if not len(pressures) or (held is not None and not held.missed):
        return ""
    where = f"{_listed(pressures)} between the recorded levels"
    if held is None:
        return f"{where}: this run does not tell how well its bands hold there"
    return f"{where}: at a level that the fit had not seen, {held} of readings fell in bands meant for 90 %"


def _beyond(pressures: Array, levels: Array, held: Held | None, which: str = EVERYTHING) -> str:
    if not len(pressures):
        return ""
    recorded = f"{levels[0]:.4g}" + (f" to {levels[-1]:.4g}" if len(levels) > 1 else "")
    line = f"{_listed(pressures)} beyond the recorded {recorded} kPa{which}"
    if held is None:
        return line
    return (
        f"{line}; at the lowest and the highest level, where the fit had not seen them, {held} of readings "
        "fell in bands meant for 90 %"
    )


def _cut(end: float, table: pd.DataFrame) -> str:
    """Curves that pull as far as they are drawn have no free contraction: its quantile is their end."""
    rows = table[(table["quantity"] == "free_contraction") & (table["q95"] >= end - 1e-9)]
    if rows.empty:
        return ""
    return (
        f"at {_some(rows['pressure_kPa'].to_numpy(dtype=float))} the free contraction's q95 of {end:.3g} is "
        "only the largest contraction that the curves are drawn to: more than 5 % of them still pull there"
    )


def _listed(pressures: Array) -> str:
    return f"{_some(pressures)} {'lies' if len(pressures) == 1 else 'lie'}"


def _some(pressures: Array) -> str:
    more = len(pressures) - SHOWN
    words = ", ".join(f"{pressure:.4g}" for pressure in pressures[:SHOWN])
    return f"{words} kPa" + (f" and {more} more" if more > 0 else "")
