"""The misfit budget as one bar, and what simulations with and without causes leave of the readings."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpam_calib.report.figures import style

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]


def budget(names: list[str], newtons: list[float], noise: float) -> Figure:
    """Newtons that each cause explains, what remains unexplained, and the noise of one reading."""
    with style.applied():
        figure = style.new_figure(0.6 + 0.42 * (len(names) + 1))
        ax = figure.subplots()
        labels = [*names, "noise of one reading"]
        values = [*newtons, noise]
        colours = [style.BLUE] * (len(names) - 1) + [style.VERMILLION, style.GREEN]
        y = np.arange(len(labels))[::-1]
        ax.barh(y, values, color=colours, height=0.62)
        for position, value in zip(y, values, strict=True):
            ax.text(value, position, f" {value:.3g} N", va="center")
        ax.set_yticks(y, labels)
        ax.set_xlim(0.0, 1.15 * max([*values, 1e-9]))
        ax.set_xlabel("size in newtons (root mean square)")
    return figure


def residual_maps(
    contraction: Floats, sign: Floats, level_kPa: Floats, residuals: Mapping[str, Floats], noise: float
) -> Figure:
    """Reading minus model against contraction, a panel for each of the ``residuals``, one colour a level."""
    levels = sorted(set(np.round(level_kPa, 1).tolist()))
    colours = style.level_colours(levels)
    with style.applied():
        figure = style.new_figure(3.4)
        axes = figure.subplots(1, len(residuals), sharey=True, squeeze=False)[0]
        for ax, (title, values) in zip(axes, residuals.items(), strict=True):
            for level in levels:
                for branch, marker in ((1.0, "^"), (-1.0, "v"), (0.0, "o")):
                    rows = (np.round(level_kPa, 1) == level) & (np.sign(sign) == branch)
                    ax.plot(
                        100.0 * contraction[rows], values[rows], marker, color=colours[level], markersize=2.5,
                        linestyle="none",
                    )  # fmt: skip
            ax.axhspan(-2.0 * noise, 2.0 * noise, color="0.85", zorder=0)
            ax.set_title(title)
            ax.set_xlabel("contraction (%)")
        axes[0].set_ylabel("reading − model (N)")
        style.label_levels(axes[-1], colours)
    return figure
