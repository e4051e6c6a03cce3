"""Force against contraction at each level: readings, simulation and bands."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from mpam_calib.report.figures import style
from mpam_calib.report.view import CalibrationView

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS = 9
POINTS_IN_PANEL = 56
LABELS = {"loading": "loading", "unloading": "unloading", "mean": "others, friction-free"}
"""Of readings without a branch the simulation, too, has no friction."""


def draw(view: CalibrationView) -> Figure:
    """One panel for each level (nine at most, evenly spread)."""
    levels = shown_levels(view)
    columns = min(3, len(levels))
    rows = math.ceil(len(levels) / columns)
    readings = view.readings("loops", "force_map")
    with style.applied():
        figure = style.new_figure(2.55 * rows + 0.2)
        grid = figure.subplots(rows, columns, sharex=True, squeeze=False)
        panels = list(grid.flat)
        drawn: set[str] = set()
        for ax, level in zip(panels, levels, strict=False):
            drawn |= _panel(ax, view, level, readings[readings["level_kPa"] == level], POINTS_IN_PANEL)
        for ax in panels[len(levels) :]:
            style.blank(ax)
        for i, ax in enumerate(panels[: len(levels)]):
            if i + columns >= len(levels):
                ax.set_xlabel("contraction (% of the length at rest)")
                ax.tick_params(labelbottom=True)
        if drawn - {"mean"}:
            _label_branches(panels[0], [branch for branch in LABELS if branch in drawn])
        for row in grid:
            row[0].set_ylabel("force (N)")
    return figure


def shown_levels(view: CalibrationView) -> list[float]:
    """The levels that get a panel, kPa."""
    return style.spread(sorted(float(x) for x in view.levels_kPa), MAX_PANELS)


def _panel(ax: Axes, view: CalibrationView, level: float, readings: pd.DataFrame, points: int) -> set[str]:
    """Returns the branches that were drawn."""
    bands = _nearest(view.quantity("force_N"), level)
    noisy = _nearest(view.quantity("force_N_observed"), level)
    branches = _branches(bands, readings)
    for branch in branches:
        colour = style.BRANCH_COLOURS[branch]
        rows = bands[bands["branch"] == branch]
        x = 100.0 * rows["contraction"].to_numpy()
        style.band(ax, x, rows, colour)
        outer = noisy[noisy["branch"] == branch]
        if not outer.empty:
            for q in ("q05", "q95"):
                ax.plot(
                    100.0 * outer["contraction"], outer[q], color=colour, linewidth=0.6, linestyle=(0, (2, 2))
                )
        rest = ~readings["branch"].isin([b for b in branches if b != "mean"])
        mine = readings[rest if branch == "mean" else readings["branch"] == branch]
        kept = style.thinned(mine.sort_values("contraction", kind="stable"), points // len(branches))
        ax.plot(
            100.0 * kept["contraction"], kept["force_N"], "o", color=colour, markerfacecolor="white",
            markersize=2.6, markeredgewidth=0.55,
        )  # fmt: skip
    ax.set_title(f"{level:g} kPa")
    ax.axhline(0.0, color=style.GREY, linewidth=0.7)
    return set(branches)


def _nearest(bands: pd.DataFrame, level: float) -> pd.DataFrame:
    if bands.empty:
        return bands
    pressures = bands["pressure_kPa"].to_numpy()
    nearest = pressures[np.argmin(np.abs(pressures - level))]
    chosen: pd.DataFrame = bands.loc[pressures == nearest]
    return chosen


def _branches(bands: pd.DataFrame, readings: pd.DataFrame) -> list[str]:
    """The branches to draw: those with readings, and the friction-free curve for all that have none."""
    seen, known = set(readings["branch"]), set(bands["branch"])
    moving = [branch for branch in ("loading", "unloading") if branch in seen and branch in known]
    return [*moving, "mean"] if not moving or seen - set(moving) else moving


def _label_branches(ax: Axes, branches: list[str]) -> None:
    """Branch names in their colours; force falls with contraction, so that corner is always free."""
    for i, branch in enumerate(branches):
        ax.text(
            0.98, 0.97 - 0.10 * i, LABELS[branch], transform=ax.transAxes, ha="right", va="top",
            color=style.BRANCH_COLOURS[branch], fontweight="bold", fontsize=8.5,
        )  # fmt: skip
