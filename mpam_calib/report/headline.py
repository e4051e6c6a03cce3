"""The numbers on a page's first screen, with their bands."""

from __future__ import annotations

from typing import Final

import pandas as pd

from mpam_calib.report.reach import still_pulling
from mpam_calib.report.view import CalibrationView

FIRST_MODULUS: Final = "first modulus E_1"


def headline_bands(view: CalibrationView) -> list[tuple[str, float, float, float]]:
    """Name, mean, q05 and q95 of each headline number whose band has two ends, in its own unit.

    The first is the largest force or stress.
    """
    chosen = _of_material(view) if view.tensile else _of_muscle(view)
    return [(words, float(row["mean"]), float(row["q05"]), float(row["q95"])) for words, row in chosen]


def stresses(view: CalibrationView) -> tuple[pd.Series, pd.Series]:
    """The band of the stress at the middle of the strains, and at their end."""
    rows = view.stress()
    return rows.iloc[(len(rows) - 1) // 2], rows.iloc[-1]


def first_modulus(view: CalibrationView) -> pd.Series | None:
    """The row of the first modulus in the summary, if there is one."""
    rows = view.summary[view.summary["parameter"] == "E_1"]
    return rows.iloc[0] if len(rows) else None


def _of_material(view: CalibrationView) -> list[tuple[str, pd.Series]]:
    middle, top = stresses(view)
    found = [
        ("stress at the largest strain", top),
        (f"stress at a strain of {middle['contraction']:.3g}", middle),
    ]
    modulus = first_modulus(view)
    return found if modulus is None else [*found, (FIRST_MODULUS, modulus)]


def _of_muscle(view: CalibrationView) -> list[tuple[str, pd.Series]]:
    found = []
    for words, quantity in (("blocked force", "blocked_force_N"), ("free contraction", "free_contraction")):
        row = view.at_level(quantity, view.top_level_kPa)
        endless = quantity == "free_contraction" and still_pulling(view, row)
        if row is not None and not endless:
            found.append((words, row))
    return found
