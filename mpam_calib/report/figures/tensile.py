"""Stress against strain of a bladder material: readings, law and bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mpam_calib.report.figures import style
from mpam_calib.report.view import CalibrationView

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 900


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
        outside = rows["extrapolated"].to_numpy(bool)
        if outside.any() and not outside.all():
            ax.axvspan(
                float(strain[~outside].max()) if outside[-1] else float(strain[0]),
                float(strain[-1]) if outside[-1] else float(strain[~outside].min()),
                color="#f3f4f6",
                linewidth=0,
                zorder=0,
            )
            edge, side = (strain[-1], "right") if outside[-1] else (strain[0], "left")
            top = ax.get_ylim()[1]
            ax.text(float(edge), top, "outside the readings", ha=side, va="top", color=style.INK)
        ax.set_xlabel("strain (elongation over the length at rest)")
        ax.set_ylabel("stress (kPa)")
    return figure
