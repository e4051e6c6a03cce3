"""Figures 4.7, 4.9, 4.10, 4.13-4.15, 4.17-4.23 as far as their curves survive."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mpam_calib.report.figures import style
from mpam_calib.thesis import decoded, friction, laws, orders
from mpam_calib.thesis.chapter3 import force, three_models
from mpam_calib.thesis.posterior import MPAM1, MPAM1_STRAND, MPAM2, MuscleBands
from mpam_calib.thesis.statistics import least_squares
from mpam_calib.thesis.tables import table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Colour = tuple[float, float, float, float]
COLOURS = {"MPAM1": style.BLUE, "MPAM2": style.VERMILLION}


def outputs(bands: dict[str, MuscleBands]) -> Figure:
    """Fig. 4.7, 4.9, 4.10: blocked force, three models of it, free contraction, against pressure."""
    P = np.linspace(0.0, 300.0, 61)
    with style.applied():
        figure = style.new_figure(3.0)
        left, middle, right = figure.subplots(1, 3)
        left.plot(P, [force(p, 0.7) for p in P], color=style.INK, label="Eq. 3.16, t = 0.7 mm")
        for muscle, colour in COLOURS.items():
            F0 = decoded.blocked_forces(muscle)
            left.plot(laws.P_KPA, F0, "o", color=colour, markersize=4, label=f"{muscle}, decoded")
            _band(left, bands.get(muscle), "blocked_force_N", colour, 1.0)
            _free(right, muscle, colour)
            _band(right, bands.get(muscle), "free_contraction", colour, 100.0)
        left.set_title("Fig. 4.7: blocked force")
        frame = three_models(P * 1e3)
        for column, line in (("G", "-"), ("G+t", "-"), ("G+t+b", "--")):
            middle.plot(frame["P_kPa"], frame[column], line, label=column)
        middle.set_title("Fig. 4.9: three models")
        right.set_title("Fig. 4.10: free contraction")
        for ax in (left, middle):
            _label(ax, "pressure (kPa)", "blocked force (N)")
        _label(right, "pressure (kPa)", "free contraction (%)")
    return figure


def _free(ax: Axes, muscle: str, colour: str) -> None:
    """Decoded free contractions of a muscle, and Table 4.12's value."""
    roots = 100.0 * decoded.free_contractions(muscle)
    ax.plot(laws.P_KPA, roots, "o-", color=colour, markersize=4, label=f"{muscle}, decoded")
    value = table("4.12").value(f"Present work (MPAM_{muscle[-1]})", "Free Contraction (%)")
    ax.plot(250.0, value, "x", color=colour, markersize=8, label=f"{muscle}, Table 4.12")


def order_selection(limits: dict[str, float]) -> Figure:
    """Fig. 4.13 and 4.17: force models of rising order at 200 kPa against the decoded averages.

    ``limits`` are the contractions up to which each muscle is fitted.
    """
    P = decoded.LEVELS[orders.LEVEL]
    with style.applied():
        figure = style.new_figure(3.0)
        numbers = (("MPAM1", "4.13", 5), ("MPAM2", "4.17", 6))
        for ax, (muscle, name, highest) in zip(figure.subplots(1, 2), numbers, strict=True):
            gamma, F = orders.curve(muscle, limits[muscle])
            G = decoded.gas_and_thickness(P, gamma)
            ax.plot(gamma, F, color=style.INK, linewidth=3.0, alpha=0.35, label="decoded average")
            ax.plot(gamma, G, color=style.GREY, label="gas and thickness")
            for order in range(1, highest + 1):
                X = decoded.columns(gamma, order)
                fitted = G + X @ least_squares(X, F - G, 1.0 / F)
                ax.plot(gamma, fitted, "--", linewidth=1.0, label=f"M = {order}")
            ax.set_title(f"Fig. {name}: order of {muscle}, 200 kPa")
            _label(ax, "contraction γ", "force (N)")
    return figure


def average_curves(bands: dict[str, MuscleBands]) -> Figure:
    """Fig. 4.14 and 4.18: the decoded average curves of the five levels, over the posterior's 90 % bands."""
    with style.applied():
        figure = style.new_figure(2.9)
        for ax, muscle, name in zip(figure.subplots(1, 2), decoded.MUSCLES, ("4.14", "4.18"), strict=True):
            shades = style.level_colours(list(laws.P_KPA))
            for P, E, level in zip(decoded.LEVELS, decoded.moduli(muscle), laws.P_KPA, strict=True):
                gamma = np.linspace(0.0, decoded.first_root(float(P), E), 100)
                ax.plot(gamma, decoded.force(P, gamma, E), color=shades[level], label=f"{level:.0f} kPa")
                _force_band(ax, bands.get(muscle), float(level), "mean", shades[level])
            ax.set_title(f"Fig. {name}: {muscle}")
            _label(ax, "contraction γ", "force (N)")
    return figure


def modulus_laws() -> Figure:
    """Fig. 4.15 and 4.19: moduli against pressure with the printed laws."""
    P = np.linspace(50.0, 260.0, 200)
    a, b = table("4.4").values()
    exponential = laws.double_exponential(table("4.9").values(), P)
    with style.applied():
        figure = style.new_figure(2.9)
        left, right = figure.subplots(1, 2)
        pairs = (
            (left, "MPAM1", a * P[:, None] + b, "Fig. 4.15: MPAM1, Eq. 4.7"),
            (right, "MPAM2", exponential, "Fig. 4.19: MPAM2, Eq. 4.8"),
        )
        for ax, muscle, curves, title in pairs:
            for k, E in enumerate(decoded.moduli(muscle).T):
                ax.plot(laws.P_KPA, E, "o", color=f"C{k}", markersize=4)
                ax.plot(P, curves[:, k], "--", color=f"C{k}", label=f"E_{k + 1}")
            ax.set_title(title)
            _label(ax, "pressure (kPa)", "modulus (Pa)")
    return figure


def strand_search() -> Figure:
    """Fig. 4.20: least-square error against f_s at 200 kPa, relative and absolute."""
    f = np.linspace(0.0, 0.8, 161)
    with style.applied():
        figure = style.new_figure(2.6)
        for ax, relative, name in zip(
            figure.subplots(1, 2), (True, False), ("relative", "absolute"), strict=True
        ):
            for limit, line in ((0.98, "-"), (0.9, "--"), (0.7, ":")):
                misfit = friction.strand_misfit(f, 3, limit, relative)
                ax.plot(
                    f,
                    misfit / misfit.min(),
                    line,
                    color=style.BLUE,
                    label=f"to {limit:g} of free contraction",
                )
            ax.axvspan(0.15, 0.25, color=style.GREY, alpha=0.2, linewidth=0)
            ax.set_ylim(0.5, 10.0)
            ax.set_title(f"Fig. 4.20: {name} least squares")
            _label(ax, "f_s", "error / least error")
    return figure


def loops(bands: dict[str, MuscleBands]) -> Figure:
    """Fig. 4.21-4.23: the theory's loops (solid: loading, dashed: unloading), over the posterior's bands."""
    one = bands.get(MPAM1)
    runs = (bands.get(MPAM1_STRAND), one if one is not None and one.coulomb else None, bands.get(MPAM2))
    with style.applied():
        figure = style.new_figure(2.9)
        cases = (("MPAM1", "strand", "4.21"), ("MPAM1", "coulomb", "4.22"), ("MPAM2", "strand", "4.23"))
        axes = figure.subplots(1, 3, sharey=True)
        for ax, (muscle, kind, name), run in zip(axes, cases, runs, strict=True):
            shades = style.level_colours(list(laws.P_KPA))
            for i, (P, E) in enumerate(zip(decoded.LEVELS, decoded.moduli(muscle), strict=True)):
                gamma = np.linspace(0.0, decoded.first_root(float(P), E), 100)
                F = decoded.force(P, gamma, E)
                strand = decoded.strand_friction(P, gamma)
                loss = strand if kind == "strand" else decoded.coulomb_factors()[i] * np.abs(F)
                for sign, line in ((1.0, "-"), (-1.0, "--")):
                    label = f"{laws.P_KPA[i]:.0f} kPa" if sign > 0 else None
                    ax.plot(
                        gamma, F + sign * loss, line, color=shades[laws.P_KPA[i]], linewidth=1.0, label=label
                    )
                    branch = "loading" if sign > 0 else "unloading"
                    _force_band(ax, run, float(laws.P_KPA[i]), branch, shades[laws.P_KPA[i]])
            ax.set_title(f"Fig. {name}: {muscle}, {kind}")
            _label(ax, "contraction γ", "force (N)" if name == "4.21" else "")
    return figure


def _band(ax: Axes, bands: MuscleBands | None, quantity: str, colour: str, scale: float) -> None:
    """A posterior's band, where there is one."""
    if bands is None:
        return
    rows = bands.bands[bands.bands["quantity"] == quantity]
    style.band(ax, rows["pressure_kPa"].to_numpy(float), rows, colour, scale)


def _force_band(ax: Axes, run: MuscleBands | None, P_kPa: float, branch: str, colour: Colour) -> None:
    """The 90 % band of a force-contraction curve, where there is a run that has it."""
    if run is None:
        return
    rows = run.curve(P_kPa, branch)
    ax.fill_between(
        rows["contraction"].to_numpy(float),
        rows["q05"].to_numpy(float),
        rows["q95"].to_numpy(float),
        color=colour,
        alpha=0.4,
        linewidth=0,
    )


def _label(ax: Axes, x: str, y: str) -> None:
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    ax.legend(frameon=False, fontsize=7)
