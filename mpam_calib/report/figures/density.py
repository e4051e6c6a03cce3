"""Smooth densities of draws, with NumPy alone."""

from __future__ import annotations

import numpy as np

from mpam_calib.report.view import CalibrationView, Floats


def spans(draws: Floats) -> bool:
    """Whether the draws spread at all: a constant has no density."""
    good = draws[np.isfinite(draws)]
    return len(good) > 1 and float(np.ptp(good)) > 1e-12 * float(np.abs(good).max())


def spread_parameters(view: CalibrationView) -> list[str]:
    """The shown parameters whose draws spread."""
    return [name for name in view.shown_parameters() if spans(view.draws[name])]


def limits(draws: Floats) -> tuple[float, float]:
    """Where an axis for draws begins and ends: nearly all of them, and some room."""
    low, high = np.quantile(draws, [0.002, 0.998])
    room = 0.12 * (high - low)
    return float(low - room), float(high + room)


def density(draws: Floats, at: Floats) -> Floats:
    """Gaussian kernel density of the draws, shape (draws,), at points of shape (points,).

    Bandwidth by Silverman's rule on the smaller of sd and scaled interquartile range; where a few draws
    reach decades further, no finer than the points can show.
    """
    x = draws[np.isfinite(draws)]
    q25, q75 = np.quantile(x, [0.25, 0.75])
    scale = min(float(x.std()), float(q75 - q25) / 1.349) or float(x.std())
    h = max(0.9 * scale * len(x) ** -0.2, float(np.ptp(at)) / len(at))
    # a histogram much finer than the bandwidth stands in for the draws: cost no longer grows with them
    low, high = max(float(x.min()), float(at.min())), min(float(x.max()), float(at.max()))
    if low - high >= 8.0 * h:
        return np.zeros(len(at))  # no draw is anywhere near
    edges = np.linspace(low - 4 * h, high + 4 * h, 513)
    counts = np.histogram(x, edges)[0]
    centres = 0.5 * (edges[1:] + edges[:-1])
    filled = counts > 0
    u = (at[:, None] - centres[filled]) / h
    kernel = np.exp(-0.5 * u**2) / (h * np.sqrt(2.0 * np.pi))
    result: Floats = kernel @ counts[filled] / len(x)
    return result


def joint_density(x: Floats, y: Floats, bins: int = 36) -> tuple[Floats, Floats, Floats]:
    """Smoothed histogram of pairs of draws: centres of x, centres of y, and density (bins y, bins x)."""
    counts, ex, ey = np.histogram2d(x, y, bins=bins, range=[limits(x), limits(y)])
    taps = np.exp(-0.5 * (np.arange(-6, 7) / 1.9) ** 2)
    taps /= taps.sum()
    for axis in (0, 1):
        counts = np.apply_along_axis(np.convolve, axis, counts, taps, mode="same")
    return 0.5 * (ex[1:] + ex[:-1]), 0.5 * (ey[1:] + ey[:-1]), counts.T


def mass_levels(density: Floats, masses: tuple[float, ...]) -> list[float]:
    """Heights above which the density holds these shares of its mass, lowest height first."""
    ordered = np.sort(density.ravel())[::-1]
    total = np.cumsum(ordered)
    total /= total[-1]
    return sorted(float(ordered[np.searchsorted(total, mass)]) for mass in masses)
