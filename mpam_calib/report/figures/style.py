"""One restrained look for every figure: colours that stay apart for colour-blind readers, few lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STYLE: Final[dict[str, Any]] = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 8.5,
    "axes.titlesize": 9,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 8.5,
    "axes.edgecolor": "#8a94a0",
    "axes.labelcolor": "#333b45",
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "axes.formatter.limits": (-4, 6),
    "text.parse_math": False,  # names are the user's: a $ in one is a $
    "grid.color": "#e8ebef",
    "grid.linewidth": 0.6,
    "xtick.color": "#8a94a0",
    "ytick.color": "#8a94a0",
    "xtick.labelcolor": "#333b45",
    "ytick.labelcolor": "#333b45",
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "figure.facecolor": "white",
    "axes.facecolor": "white",
    "savefig.facecolor": "white",
    "path.simplify": True,
}
WIDTH: Final = 9.2
"""Width of a full-width figure, inches."""

BLUE, VERMILLION, GREEN, INK, GREY = "#0072b2", "#d55e00", "#00805e", "#333b45", "#8a94a0"
BRANCH_COLOURS: Final[dict[str, str]] = {"loading": BLUE, "unloading": VERMILLION, "mean": GREEN}
BRANCH_WORDS: Final[dict[str, str]] = {
    "loading": "loading (pulled back to length)",
    "unloading": "unloading (contracting)",
    "pressurising": "pressurising",
    "depressurising": "depressurising",
    "mean": "friction-free",
}


def applied(changes: Mapping[str, Any] | None = None) -> AbstractContextManager[None]:
    """A context in which figures take this style, with changes for one of them."""
    import matplotlib as mpl

    settings: Any = {**STYLE, **(changes or {})}
    return mpl.rc_context(settings)


def new_figure(height: float, width: float = WIDTH) -> Figure:
    """An empty figure (inches) outside pyplot, so that nothing has to be closed."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def level_colours(levels: Sequence[float]) -> dict[float, tuple[float, float, float, float]]:
    """A colour for each pressure level, dark to light with rising pressure."""
    import matplotlib as mpl

    shades = np.linspace(0.0, 0.7, max(len(levels), 1))
    return {level: mpl.colormaps["viridis"](shade) for level, shade in zip(levels, shades, strict=False)}


def label_levels(ax: Axes, colours: Mapping[float, tuple[float, float, float, float]]) -> None:
    """Levels (kPa, rising) as words of their colours in the margin, highest on top."""
    for i, level in enumerate(reversed(spread(list(colours), 12))):
        ax.text(
            1.03, 0.95 - 0.075 * i, f"{level:g} kPa", color=colours[level], transform=ax.transAxes,
            va="top", fontweight="bold", fontsize=8,
        )  # fmt: skip


def spread(items: Sequence[float], at_most: int) -> list[float]:
    """At most so many of the items, evenly spread and with both ends.

    >>> spread([1, 2, 3, 4, 5], 3)
    [1, 3, 5]
    """
    if len(items) <= at_most:
        return list(items)
    return [items[i] for i in np.round(np.linspace(0, len(items) - 1, at_most)).astype(int)]


def thinned(frame: pd.DataFrame, at_most: int) -> pd.DataFrame:
    """At most so many rows, evenly spread: a page need not draw what nobody can tell apart."""
    if len(frame) <= at_most:
        return frame
    return frame.iloc[np.unique(np.round(np.linspace(0, len(frame) - 1, at_most)).astype(int))]


def band(ax: Axes, x: Any, rows: pd.DataFrame, colour: str, scale: float = 1.0) -> None:
    """Median with its 50 % and 90 % band along x; ``scale`` multiplies the band's values."""
    q05, q25, q50, q75, q95 = (rows[q].to_numpy() * scale for q in ("q05", "q25", "q50", "q75", "q95"))
    ax.fill_between(x, q05, q95, color=colour, alpha=0.20, linewidth=0)
    ax.fill_between(x, q25, q75, color=colour, alpha=0.35, linewidth=0)
    ax.plot(x, q50, color=colour, linewidth=1.2)


def blank(ax: Axes) -> None:
    """Switch a panel off that has nothing to show."""
    ax.set_axis_off()
