"""Blocked force and free contraction against pressure."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from mpam_calib.report.figures import style
from mpam_calib.report.view import CalibrationView

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

POINTS = 300


def draw(view: CalibrationView) -> Figure:
    """Two panels: bands over the pressures of ``bands``, and readings where there are any."""
    with style.applied():
        figure = style.new_figure(3.3)
        left, right = figure.subplots(1, 2)
        _panel(left, view, "blocked_force_N", style.BLUE, 1.0)
        _panel(right, view, "free_contraction", style.GREEN, 100.0)
        forces = style.thinned(view.readings("blocked_force"), POINTS)
        _points(left, forces["pressure_kPa"], forces["force_N"])
        lengths = style.thinned(view.readings("free_contraction"), POINTS)
        _points(right, lengths["pressure_kPa"], 100.0 * lengths["contraction"])
        left.set_title("Blocked force")
        left.set_ylabel("force at full length (N)")
        right.set_title("Free contraction")
        right.set_ylabel("contraction without load (%)")
        for ax in (left, right):
            ax.set_xlabel("pressure (kPa)")
            ax.set_ylim(bottom=min(0.0, ax.get_ylim()[0]))
    return figure


def _panel(ax: Axes, view: CalibrationView, quantity: str, colour: str, scale: float) -> None:
    rows = view.quantity(quantity)
    x = rows["pressure_kPa"].to_numpy(float)
    if len(rows) == 0:
        return
    style.band(ax, x, rows, colour, scale)
    outside = rows["extrapolated"].to_numpy(bool)
    # a filled dot where readings support the level, a hollow one where they do not
    middle = scale * rows["q50"].to_numpy(float)
    at_level = np.isin(x, np.asarray(view.levels_kPa, float))
    for chosen, face in ((at_level & ~outside, colour), (at_level & outside, "white")):
        ax.plot(
            x[chosen], middle[chosen], "o", color=colour, markerfacecolor=face, markersize=4.5,
            markeredgewidth=1.1,
        )  # fmt: skip


def _points(ax: Axes, x: ArrayLike, y: ArrayLike) -> None:
    ax.plot(x, y, "x", color=style.INK, markersize=4, markeredgewidth=0.9)
