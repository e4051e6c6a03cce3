"""What the simulation misses: readings minus simulation along the stroke, or along the strain."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, cast

import numpy as np
import pandas as pd

from mpam_calib.report.figures import style
from mpam_calib.report.view import CalibrationView, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BINS = 24
POINTS_ON_PAGE = 1500


def draw(view: CalibrationView) -> Figure:
    """One panel for each branch, a line for each level: means over short stretches of the stroke."""
    readings = _residuals(view.readings("loops", "force_map"))
    known = [b for b in style.BRANCH_WORDS if b in set(readings["branch"])]
    groups = [(b, readings[readings["branch"] == b]) for b in known]
    rest = readings[~readings["branch"].isin(known)]
    if len(rest):
        groups.append(("", rest))
    levels = sorted(readings["level_kPa"].unique())
    colours = style.level_colours(levels)
    with style.applied():
        figure = style.new_figure(3.3)
        axes = figure.subplots(1, max(len(groups), 1), sharey=True, squeeze=False)[0]
        for ax, (branch, rows) in zip(axes, groups, strict=False):
            _panel(ax, rows, colours, POINTS_ON_PAGE // len(groups), view.noise, 100.0)
            ax.set_title(style.BRANCH_WORDS.get(branch, "all readings"))
            ax.set_xlabel("contraction (% of the length at rest)")
        axes[0].set_ylabel("reading − simulation (N)")
        style.label_levels(axes[-1], colours)
    return figure


def draw_stress(view: CalibrationView) -> Figure:
    """A tensile test's readings minus its law; the noise (Pa) is known where there is no muscle beside it."""
    readings = _residuals(view.readings("tensile")).assign(level_kPa=0.0)
    with style.applied():
        figure = style.new_figure(3.3)
        ax = figure.subplots()
        noise = view.noise if view.tensile else math.nan
        _panel(ax, readings, style.level_colours([0.0]), POINTS_ON_PAGE, noise, 1.0)
        ax.set_xlabel("strain")
        ax.set_ylabel("reading − simulation (Pa)")
    return figure


def _residuals(readings: pd.DataFrame) -> pd.DataFrame:
    readings = readings[~readings["censored"].fillna(False).astype(bool)]
    return readings.assign(residual=readings["force_N"] - readings["fitted_N"])


def _panel(
    ax: Axes,
    rows: pd.DataFrame,
    colours: dict[float, tuple[float, float, float, float]],
    points: int,
    noise: float,
    scale: float,
) -> None:
    """``scale`` multiplies the contraction or strain; ``noise`` in the unit of the readings."""
    if math.isfinite(noise):
        ax.axhspan(-noise, noise, color="#eceff3", linewidth=0)
    ax.axhline(0.0, color=style.GREY, linewidth=0.8)
    for level, group in rows.groupby("level_kPa", sort=True):
        colour = colours[cast(float, level)]
        kept = style.thinned(group.sort_values("contraction", kind="stable"), max(points // len(colours), 20))
        ax.plot(
            scale * kept["contraction"], kept["residual"], ".", color=colour, markersize=3.2, alpha=0.40,
            markeredgewidth=0,
        )  # fmt: skip
        x, y = binned(group["contraction"].to_numpy(float), group["residual"].to_numpy(float))
        ax.plot(scale * x, y, color=colour, linewidth=1.5)


def binned(x: Floats, y: Floats, bins: int = BINS) -> tuple[Floats, Floats]:
    """Means of x and y over stretches of equal length; shape (filled bins,)."""
    if len(x) == 0:
        return x, y
    low, high = float(x.min()), float(x.max())
    width = (high - low) or 1.0
    place = np.minimum(((x - low) / width * bins).astype(int), bins - 1)
    count = np.bincount(place, minlength=bins)
    filled = count > 0
    sums = (np.bincount(place, weights=v, minlength=bins)[filled] for v in (x, y))
    mean_x, mean_y = (s / count[filled] for s in sums)
    return mean_x, mean_y
