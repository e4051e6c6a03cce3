"""Prior beside posterior: how much the data taught."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from mpam_calib.report.figures import style
from mpam_calib.report.figures.density import density, spans, spread_parameters
from mpam_calib.report.figures.labels import axis_scale
from mpam_calib.report.view import CalibrationView, Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def draw(view: CalibrationView) -> Figure:
    """A panel for each headline parameter: posterior filled, prior as a grey line."""
    names = spread_parameters(view)
    columns = min(4, max(len(names), 1))
    rows = max(1, math.ceil(len(names) / columns))
    with style.applied({"axes.grid": False}):
        figure = style.new_figure(1.75 * rows + 0.15)
        panels = list(figure.subplots(rows, columns, squeeze=False).flat)
        for ax, name in zip(panels, names, strict=False):
            scale, label = axis_scale(view, name)
            prior = view.prior_draws.get(name)
            _panel(ax, scale * view.draws[name], None if prior is None else scale * prior)
            ax.set_title(label)
        for ax in panels[len(names) :]:
            style.blank(ax)
    return figure


def _panel(ax: Axes, draws: Floats, prior: Floats | None) -> None:
    from matplotlib.ticker import MaxNLocator

    x = window(draws, prior)
    posterior = density(draws, x)
    ax.fill_between(x, posterior, color=style.BLUE, alpha=0.30, linewidth=0)
    ax.plot(x, posterior, color=style.BLUE, linewidth=1.2)
    if prior is not None and spans(prior):
        ax.plot(x, density(prior, x), color=style.GREY, linewidth=1.4)
    ax.set_xlim(float(x[0]), float(x[-1]))
    ax.set_ylim(bottom=0.0)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.xaxis.set_major_locator(MaxNLocator(4))


def window(draws: Floats, prior: Floats | None) -> Floats:
    """Points that show the posterior whole, and the prior as far as it stays readable; shape (240,)."""
    low, high = np.quantile(draws, [0.002, 0.998])
    width = high - low
    left, right = low - 0.25 * width, high + 0.25 * width
    if prior is not None and spans(prior):
        prior_low, prior_high = np.quantile(prior, [0.005, 0.995])
        left = min(left, max(prior_low, low - 1.5 * width))
        right = max(right, min(prior_high, high + 1.5 * width))
    return np.linspace(left, right, 240)
