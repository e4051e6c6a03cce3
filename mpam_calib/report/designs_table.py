"""The best designs of one case as a table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.design.robust import Design
from mpam_calib.prediction.curves import LIMIT
from mpam_calib.report.blocks import DataTable
from mpam_calib.report.design_bounds import marks
from mpam_calib.report.numbers import fixed, with_band, with_open_end
from mpam_calib.units import DEG, KPA, MM

if TYPE_CHECKING:
    from mpam_calib.report.designs import DesignsView

Array = NDArray[np.float64]

AIMS = {"posterior_mean": "mean", "q05": "5 %"}


def mean_band(draws: Array) -> tuple[str, str]:
    """Mean and 90 % band of draws."""
    low, middle, high = np.quantile(draws, [0.05, 0.5, 0.95])
    return with_band(float(draws.mean()), float(low), float(high), float(middle))


def contraction_band(draws: Array) -> tuple[str, str]:
    """Mean and 90 % band of free contractions, in percent; an end where no root was found says so."""
    percent = 100.0 * draws
    low, middle, high = np.quantile(percent, [0.05, 0.5, 0.95])
    if high < 100.0 * LIMIT - 1e-7:
        return mean_band(percent)
    return with_open_end(float(percent.mean()), float(low), float(high), float(middle))


def same_design(a: Design, b: Design) -> bool:
    """Whether two searches ended in one design."""
    return bool(np.allclose(a.x, b.x, rtol=1e-4))


def designs_of(view: DesignsView, case: str) -> DataTable:
    """The designs of a case: one row where both aims lead to the same one."""
    outside = view.reach.outside(np.array(view.pressures))
    rows = []
    for i, (mean, cautious) in enumerate(zip(view.best(case), view.best(case, "q05"), strict=True)):
        same = same_design(mean, cautious)
        for d in (mean,) if same else (mean, cautious):
            force, force_band = mean_band(d.force)
            free, free_band = contraction_band(d.contraction)
            at = marks(d.held_by)
            values = [("R", "R mm", fixed(d.x[0] / MM, 2)), ("t", "t mm", fixed(d.x[1] / MM, 3))]
            values.append(("α", "α °", fixed(d.x[2] / DEG, 1)))
            if len(d.x) == 5:
                values += [("R_br", "R_br mm", fixed(d.x[3] / MM, 2)), ("n", "n", f"{d.x[4]:.0f}")]
            row = {
                "kPa": f"{d.P / KPA:.0f}{'*' if outside[i] else ''}",
                "aim": "both" if same else AIMS[d.method],
                **{column: f"{value}{at.get(symbol, '')}" for symbol, column, value in values},
            }
            row["blocked force N"] = f"{force} ({force_band})"
            if view.of_the_thesis:
                row["Table 3.5 N"] = f"{view.printed[case][i]:.2f}"
            rows.append(row | {"free contraction %": f"{free} ({free_band})"})
    caption = (
        f"Case {case}: mean and 90 % band of the designs whose mean, or 5 % quantile, is the largest. "
        "Held by: ↑ ↓ its upper, lower bound; † the least V_bl/V."
    )
    caption += " *: outside the recorded pressures." if outside.any() else ""
    frame = pd.DataFrame(rows)
    wrapped = {"aim", "free contraction %"}
    return DataTable(frame, caption, dict.fromkeys(set(frame.columns) - wrapped, "{}"))
