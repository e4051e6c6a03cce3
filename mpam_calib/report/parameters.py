"""Tables of parameters as the report prints them."""

from __future__ import annotations

import pandas as pd

from mpam_calib.report.numbers import fixed, row_with_band, significant
from mpam_calib.report.trust import LITTLE, UNIDENTIFIED, WIDE_BAD
from mpam_calib.report.view import CalibrationView

RIGHT = dict.fromkeys(
    ("mean", "sd", "90 % band", "prior sd", "R-hat", "ESS bulk", "ESS tail", "learnt"), "{}"
)
"""Columns that hold printed numbers: aligned right."""


def summary_table(view: CalibrationView, names: list[str] | None = None) -> pd.DataFrame:
    """``summary`` for print: all parameters, or the named ones in their order, with their meaning."""
    frame = view.summary
    if names is not None:
        order = {name: i for i, name in enumerate(names)}
        frame = frame[frame["parameter"].isin(names)]
        frame = frame.sort_values("parameter", key=lambda column: column.map(order), kind="stable")
    rows = []
    for row in frame.to_dict("records"):
        mean, band = row_with_band(row)
        unit = row["unit"] if isinstance(row["unit"], str) else ""
        rows.append(
            {
                "parameter": row["parameter"],
                "what it is": view.meanings.get(str(row["parameter"]), ""),
                "unit": unit,
                "mean": mean,
                "90 % band": band,
                "sd": significant(float(row["sd"]), 2),
                "prior sd": significant(float(row["prior_sd"]), 2),
                "R-hat": fixed(float(row["rhat"]), 3),
                "ESS bulk": fixed(float(row["ess_bulk"]), 0),
                "ESS tail": fixed(float(row["ess_tail"]), 0),
            }
        )
    return pd.DataFrame(rows)


def learnt_table(view: CalibrationView) -> pd.DataFrame:
    """How much narrower than its prior each parameter became, least first."""
    bands = view.summary.set_index("parameter")[["q05", "q95"]]
    rows = []
    for row in view.unidentified.sort_values("contraction", kind="stable").to_dict("records"):
        learnt = float(row["contraction"])
        q05, q95 = bands.loc[row["parameter"]] if row["parameter"] in bands.index else (1.0, 1.0)
        rows.append(
            {
                "parameter": row["parameter"],
                "prior sd": significant(float(row["prior_sd"]), 2),
                "sd": significant(float(row["posterior_sd"]), 2),
                "learnt": f"{100 * max(learnt, 0.0):.0f} %",
                "what that means": _sentence(learnt, float(q05), float(q95)),
            }
        )
    return pd.DataFrame(rows)


def _sentence(learnt: float, low: float, high: float) -> str:
    if learnt < UNIDENTIFIED:
        return "The data say nothing about it: what you see is what was assumed before the test."
    if learnt < LITTLE:
        return "The data say a little; the prior still matters."
    if low < 0.0 < high:
        return "The data narrow it down, but leave its sign open."
    # A band that is wide beside its value is no number to quote, however little was known before.
    if high - low > WIDE_BAD * abs(high + low):
        return "The data narrow it down; its band is wide."
    return "The data determine it."
