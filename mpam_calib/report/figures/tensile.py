"""Stress against strain of a bladder material: readings, law and bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mpam_calib.report.figures import style
from mpam_calib.report.view import CalibrationView, Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 900


def unread(strain: Floats, outside: NDArray[np.bool_]) -> list[tuple[float, float]]:
    """Strains below and above the readings, from and to; none where all, or none, lie outside."""
    if outside.all():
        return []
    low, high = float(strain[~outside].min()), float(strain[~outside].max())
    sides = ((float(strain[0]), low), (high, float(strain[-1])))
    return [(start, end) for start, end in sides if start < end]


def draw(view: CalibrationView) -> Figure:
    """Stress in kPa over strain, with the 50 % and 90 % bands."""
    rows = view.quantity("stress_Pa")
    readings = style.thinned(view.readings("tensile"), POINTS)
    with style.applied():
        figure = style.new_figure(3.9, width=0.8 * style.WIDTH)
        ax = figure.subplots()
        ax.plot(
            readings["contraction"], 1e-3 * readings["force_N"], ".", color=style.INK, markersize=3,
            alpha=0.4, markeredgewidth=0,
        )  # fmt: skip
        strain = rows["contraction"].to_numpy(float)
        style.band(ax, strain, rows, style.BLUE, 1e-3)
        top = ax.get_ylim()[1]
        for low, high in unread(strain, rows["extrapolated"].to_numpy(bool)):
            ax.axvspan(low, high, color="#f3f4f6", linewidth=0, zorder=0)
            edge, side = (high, "right") if high == strain[-1] else (low, "left")
            ax.text(edge, top, "outside the readings", ha=side, va="top", color=style.INK)
        ax.set_xlabel("strain (elongation over the length at rest)")
        ax.set_ylabel("stress (kPa)")
    return figure
