"""How the headline parameters hang together: pairs of parameters as contours."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpam_calib.report.figures import style
from mpam_calib.report.figures.density import density, joint_density, mass_levels, spans
from mpam_calib.report.view import CalibrationView, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MASSES = (0.5, 0.9)


def draw(view: CalibrationView) -> Figure:
    """Lower triangle of pairs with the regions that hold 50 % and 90 %; densities on the diagonal."""
    names = [name for name in view.shown_parameters() if spans(view.draws[name])]
    n = len(names)
    size = style.WIDTH if n > 4 else 2.0 * n + 1.0
    left, gap = 0.85 / size, 0.08 / size
    cell = (1.0 - left - 0.1 / size) / max(n, 1)
    with style.applied({"axes.grid": False, "axes.formatter.limits": (-3, 4)}):
        figure = style.new_figure(size, width=size)
        figure.set_layout_engine("none")
        for row in range(n):
            for column in range(row + 1):
                place = (left + column * cell, left + (n - 1 - row) * cell, cell - gap, cell - gap)
                ax = figure.add_axes(place)
                if row == column:
                    _diagonal(ax, view.draws[names[row]])
                else:
                    _pair(ax, view.draws[names[column]], view.draws[names[row]])
                _frame(ax, view, names, row, column)
    return figure


def correlations(view: CalibrationView) -> list[tuple[str, str, float]]:
    """Pairs of shown parameters with their correlation, strongest first."""
    names = [name for name in view.shown_parameters() if spans(view.draws[name])]
    if len(names) < 2:
        return []
    matrix: Floats = np.atleast_2d(np.corrcoef(np.stack([view.draws[name] for name in names])))
    pairs = [(a, b, float(matrix[i, j])) for i, a in enumerate(names) for j, b in enumerate(names) if i < j]
    return sorted(pairs, key=lambda pair: -abs(pair[2]))


def _diagonal(ax: Axes, draws: Floats) -> None:
    low, high = _limits(draws)
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
    ax.set_ylim(*_limits(y))


def _limits(draws: Floats) -> tuple[float, float]:
    low, high = np.quantile(draws, [0.002, 0.998])
    room = 0.12 * (high - low)
    return float(low - room), float(high + room)


def _frame(ax: Axes, view: CalibrationView, names: list[str], row: int, column: int) -> None:
    from matplotlib.ticker import MaxNLocator

    ax.set_xlim(*_limits(view.draws[names[column]]))
    ax.xaxis.set_major_locator(MaxNLocator(2, prune="both"))
    ax.yaxis.set_major_locator(MaxNLocator(2, prune="both"))
    ax.tick_params(length=2, labelsize=7)
    if row == len(names) - 1:
        ax.set_xlabel(_label(view, names[column]), fontsize=8)
    else:
        ax.tick_params(labelbottom=False)
    if row == column:
        ax.set_yticks([])
        ax.spines["left"].set_visible(False)
    elif column == 0:
        ax.set_ylabel(_label(view, names[row]), fontsize=8)
        ax.yaxis.set_label_coords(-0.45, 0.5)
    else:
        ax.tick_params(labelleft=False)
    ax.xaxis.get_offset_text().set_fontsize(6.5)
    ax.yaxis.get_offset_text().set_fontsize(6.5)


def _label(view: CalibrationView, name: str) -> str:
    unit = view.unit_of(name)
    return f"{name} ({unit})" if unit else name
