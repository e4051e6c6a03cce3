"""Blocked force and free contraction of the best designs against pressure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.report.figures import style
from mpam_calib.units import KPA

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from mpam_calib.report.designs import DesignsView

Array = NDArray[np.float64]

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)


def draw(view: DesignsView) -> Figure:
    """Blocked force and free contraction against pressure, one row of panels for each case."""
    P = np.array(view.pressures) / KPA
    with style.applied():
        figure = style.new_figure(5.2)
        for row, case in enumerate(("I", "II")):
            left, right = (figure.add_subplot(2, 2, 2 * row + column) for column in (1, 2))
            mean, other = view.best(case), view.best(case, "q05")
            for ax, colour, scale, quantity in (
                (left, style.BLUE, 1.0, "force"),
                (right, style.GREEN, 100.0, "contraction"),
            ):
                style.band(ax, P, _quantiles([getattr(d, quantity) for d in mean]), colour, scale)
                ends = scale * _quantiles([getattr(d, quantity) for d in other])[["q05", "q95"]].to_numpy()
                ax.plot(P, ends, "--", color=style.INK, linewidth=0.8)
                _shade(ax, P, view.levels / KPA)
                ax.set_ylim(bottom=0.0)
            if view.of_the_thesis:
                left.plot(P, view.printed[case], "x", color=style.INK, markersize=5, label="Table 3.5")
                left.legend(frameon=False, fontsize=7.5)
            left.set_title(f"Case {case}: blocked force")
            right.set_title(f"Case {case}: free contraction")
            left.set_ylabel("blocked force (N)")
            right.set_ylabel("contraction without load (%)")
        for ax in figure.axes[2:]:
            ax.set_xlabel("pressure (kPa)")
    return figure


def _quantiles(draws: Sequence[Array]) -> pd.DataFrame:
    """One row of quantiles for each set of draws."""
    names = [f"q{round(100 * q):02d}" for q in QUANTILES]
    return pd.DataFrame(np.array([np.quantile(d, QUANTILES) for d in draws]), columns=names)


def _shade(ax: Axes, P: Array, levels: Array) -> None:
    """Grey where the pressure was not recorded."""
    for low, high in ((float(P.min()), float(levels[0])), (float(levels[-1]), float(P.max()))):
        if high > low:
            ax.axvspan(low, high, color=style.GREY, alpha=0.12, linewidth=0)
