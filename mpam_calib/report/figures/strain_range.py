"""What the strain range of a tensile fit does to the moduli and to what they predict."""

from __future__ import annotations

import math
import textwrap
from typing import TYPE_CHECKING

from mpam_calib.report.figures import style
from mpam_calib.report.view import CalibrationView

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAX_PANELS = 8
TITLE = 22
"""Characters of a panel's title that fit its width."""
SHARE = "share of length"
"""What an axis says whose quantity has no unit."""


def draw(view: CalibrationView) -> Figure:
    """A panel for each quantity: its mean and 90 % band for every range, the range in use filled."""
    from matplotlib.ticker import MaxNLocator

    frame = view.strain_range
    quantities = list(dict.fromkeys(frame["quantity"]))[:MAX_PANELS]
    ranges = list(dict.fromkeys(zip(frame["strain_low"], frame["strain_high"], strict=True)))
    columns = min(4, len(quantities))
    rows = math.ceil(len(quantities) / columns)
    titles = [textwrap.fill(str(quantity), TITLE) for quantity in quantities]
    lines = max(title.count("\n") for title in titles)
    with style.applied():
        figure = style.new_figure(rows * (0.8 + 0.15 * lines + 0.28 * len(ranges)) + 0.3)
        panels = list(figure.subplots(rows, columns, squeeze=False, sharey=True).flat)
        for ax, quantity, title in zip(panels, quantities, titles, strict=False):
            mine = frame[frame["quantity"] == quantity]
            for low, high, used, mean, q05, q95 in mine[
                ["strain_low", "strain_high", "used", "mean", "q05", "q95"]
            ].itertuples(index=False, name=None):
                y = ranges.index((low, high))
                ax.plot([q05, q95], [y, y], color=style.BLUE, linewidth=2.2 if used else 1.2)
                ax.plot(
                    [mean],
                    [y],
                    "o",
                    color=style.BLUE,
                    markerfacecolor=style.BLUE if used else "white",
                    markersize=5,
                )
            ax.set_title(title, fontsize=8.5)
            ax.set_xlabel(str(mine["unit"].iloc[0]) or SHARE)
            ax.set_yticks(range(len(ranges)), [f"{low:g} to {high:g}" for low, high in ranges])
            ax.set_ylim(len(ranges) - 0.5, -0.5)
            ax.xaxis.set_major_locator(MaxNLocator(4))
            ax.margins(x=0.15)
        for ax in panels[len(quantities) :]:
            style.blank(ax)
        for i in range(0, len(quantities), columns):
            panels[i].set_ylabel("strain range of the fit")
    return figure
