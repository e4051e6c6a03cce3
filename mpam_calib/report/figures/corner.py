"""How the headline parameters hang together: pairs of parameters as contours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpam_calib.report.figures import style
from mpam_calib.report.figures.density import density, joint_density, limits, mass_levels, spread_parameters
from mpam_calib.report.figures.labels import axis_scale
from mpam_calib.report.view import CalibrationView, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MASSES = (0.5, 0.9)
LEFT, BOTTOM, RIGHT, GAP = 0.85, 0.5, 0.1, 0.1
"""Margins and the gap between panels, inches."""


def draw(view: CalibrationView) -> Figure:
    """Lower triangle of pairs with the regions that hold 50 % and 90 %; densities on the diagonal."""
    names = spread_parameters(view)
    scales = [axis_scale(view, name) for name in names]
    draws = [factor * view.draws[name] for name, (factor, _) in zip(names, scales, strict=True)]
    labels = [label for _, label in scales]
    n = max(len(names), 1)
    width = style.WIDTH if n > 4 else 1.9 * n + LEFT + RIGHT
    cell = (width - LEFT - RIGHT) / n
    height = n * cell + BOTTOM + RIGHT
    with style.applied({"axes.grid": False, "xtick.labelsize": 7, "ytick.labelsize": 7}):
        figure = style.new_figure(height, width=width)
        figure.set_layout_engine("none")
        for row in range(len(names)):
            for column in range(row + 1):
                corner = ((LEFT + column * cell) / width, (BOTTOM + (n - 1 - row) * cell) / height)
                ax = figure.add_axes((*corner, (cell - GAP) / width, (cell - GAP) / height))
                if row == column:
                    _diagonal(ax, draws[row])
                    ax.set_title(names[row], fontsize=7.5, loc="center")
                else:
                    _pair(ax, draws[column], draws[row])
                ax.set_xlim(*limits(draws[column]))
                _frame(ax, labels, row, column, cell - GAP)
    return figure


def correlations(view: CalibrationView) -> list[tuple[str, str, float]]:
    """Pairs of shown parameters with their correlation, strongest first."""
    names = spread_parameters(view)
    if len(names) < 2:
        return []
    matrix: Floats = np.atleast_2d(np.corrcoef(np.stack([view.draws[name] for name in names])))
    pairs = [(a, b, float(matrix[i, j])) for i, a in enumerate(names) for j, b in enumerate(names) if i < j]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def _diagonal(ax: Axes, draws: Floats) -> None:
    low, high = limits(draws)
    x = np.linspace(low, high, 120)
    y = density(draws, x)
    ax.fill_between(x, y, color=style.BLUE, alpha=0.30, linewidth=0)
    ax.plot(x, y, color=style.BLUE, linewidth=1.0)
    ax.set_ylim(0.0, 1.1 * float(y.max()))


def _pair(ax: Axes, x: Floats, y: Floats) -> None:
    cx, cy, height = joint_density(x, y)
    levels = mass_levels(height, MASSES)
    if levels[0] < levels[1] < float(height.max()):
        ax.contourf(cx, cy, height, levels=[*levels, float(height.max())], colors=["#b3d2e6", "#5aa0cb"])
    ax.set_ylim(*limits(y))


def _frame(ax: Axes, labels: list[str], row: int, column: int, size: float) -> None:
    """Ticks away from the corners, where neighbours' labels would meet; words on the outer sides only."""
    ax.set_xticks(_inner_ticks(*ax.get_xlim()))
    ax.tick_params(length=2)
    if row == len(labels) - 1:
        ax.set_xlabel(labels[column], fontsize=7.5)
    else:
        ax.tick_params(labelbottom=False)
    if row == column:
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
        return
    ax.set_yticks(_inner_ticks(*ax.get_ylim()))
    if column == 0:
        ax.set_ylabel(labels[row], fontsize=7.5)
        ax.yaxis.set_label_coords(-0.56 / size, 0.5)
    else:
        ax.tick_params(labelleft=False)


def _inner_ticks(low: float, high: float) -> list[float]:
    from matplotlib.ticker import MaxNLocator

    length = high - low
    ticks: list[float] = []
    for count in (2, 3, 4, 6):
        found = MaxNLocator(count).tick_values(low, high)
        ticks = [float(t) for t in found if low + 0.12 * length <= t <= high - 0.12 * length]
        if len(ticks) >= 2 and ticks[-1] - ticks[0] >= 0.4 * length:
            return [ticks[0], ticks[-1]]
    return ticks[:1]
