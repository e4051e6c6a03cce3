"""Figures 3.1-3.6."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpam_calib.report.figures import style
from mpam_calib.thesis.chapter3 import Chapter3, three_models
from mpam_calib.thesis.tables import table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def histories(chapter: Chapter3) -> Figure:
    """Fig. 3.1, 3.3, 3.4: how the local and the evolutionary searches approach the optimum, both cases."""
    with style.applied():
        figure = style.new_figure(2.8)
        left, right = figure.subplots(1, 2)
        for name, run, colour in (
            ("Case I", chapter.case_one, style.VERMILLION),
            ("Case II", chapter.case_two, style.BLUE),
        ):
            for stage, line in zip(run.stages, ("-", "--"), strict=True):
                steps = np.arange(1, len(stage.history) + 1)
                distance = np.abs(np.array(stage.history) - run.best.value)
                left.semilogy(steps, distance, line, color=colour, label=f"{name}, GA+{stage.method}")
            steps = np.arange(1, len(run.start.history) + 1)
            right.plot(steps, run.start.history, color=colour, label=name)
        left.set_ylim(bottom=1e-8)
        left.set_title("Local search (Fig. 3.1, 3.3, 3.4)")
        right.set_title("Evolutionary search before it")
        _label(left, "iteration", "distance from the optimum (N)")
        _label(right, "iteration", "blocked force (N)")
    return figure


def over_pressure(chapter: Chapter3) -> Figure:
    """Fig. 3.2 and 3.5: three force models, and the optimum with the printed values, against pressure."""
    frame = three_models(np.linspace(0.0, 600e3, 61))
    names = ("Gaylord", "with thickness", "with thickness and braid")
    looks = ((style.VERMILLION, "-"), (style.BLUE, "-"), (style.GREEN, "--"))
    printed, found = table("3.5"), chapter.by_pressure
    with style.applied():
        figure = style.new_figure(2.9)
        left, right = figure.subplots(1, 2)
        for column, name, (colour, line) in zip(("G", "G+t", "G+t+b"), names, looks, strict=True):
            left.plot(frame["P_kPa"], frame[column], line, color=colour, label=name)
        left.set_title("Fig. 3.2: three models of the optimum")
        right.plot(found["P_kPa"], found["case_two_N"], color=style.BLUE, label="Case II, recomputed")
        x = [float(row) for row in printed.rows]
        for case, mark in (("I", "x"), ("II", "+")):
            y = [printed.value(row, f"Cost function (Case {case})") for row in printed.rows]
            right.plot(x, y, mark, color=style.INK, label=f"Case {case}, printed")
        right.set_title("Fig. 3.5: optimum by pressure")
        for ax in (left, right):
            _label(ax, "pressure (kPa)", "blocked force (N)")
    return figure


def sensitivity(chapter: Chapter3) -> Figure:
    """Fig. 3.6: radius, bound on V_bl/V, and braid angle, ± 5 %."""
    with style.applied():
        figure = style.new_figure(2.6)
        axes = figure.subplots(1, 3, sharey=True)
        around = chapter.around
        for ax, symbol, label in ((axes[0], "R", "outer radius (mm)"), (axes[2], "α", "braid angle (°)")):
            rows = around[around["variable"] == symbol]
            ax.plot(rows["value"], rows["force_N"], "o-", color=style.BLUE, markersize=3)
            ax.set_xlabel(label)
        bound = chapter.ratio_bound
        axes[1].plot(bound["bound"], bound["force_N"], "o-", color=style.BLUE, markersize=3)
        axes[1].set_xlabel("lower bound of V_bl/V")
        axes[0].set_ylabel("blocked force (N)")
        for ax, letter in zip(axes, "abc", strict=True):
            ax.set_title(f"Fig. 3.6{letter}")
    return figure


def _label(ax: Axes, x: str, y: str) -> None:
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.legend(frameon=False, fontsize=7.5)
