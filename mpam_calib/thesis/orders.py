"""Order selection as in Tables 4.2 and 4.6, on the decoded average curve at 200 kPa."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mpam_calib.thesis import decoded
from mpam_calib.thesis.statistics import determination, least_squares, rmse, squared_correlation

Array = NDArray[np.float64]

LEVEL = 3
"""200 kPa, the level that the two tables are for."""
POINTS = 400
MATERIAL = np.array([3.769e4, 2.676e4])
"""Table 4.1, Pa."""


@dataclass(frozen=True)
class Fit:
    """One force model against the decoded average: both kinds of R² and the residual, N.

    ``order`` is that of its polynomial, 0 where nothing was fitted.
    """

    model: str
    squared_correlation: float
    determination: float
    rmse_N: float
    order: int = 0


def curve(muscle: str, limit: float) -> tuple[Array, Array]:
    """Contraction from 0 to ``limit`` and the decoded force (N) at 200 kPa."""
    gamma = np.linspace(0.0, limit, POINTS)
    P = decoded.LEVELS[LEVEL]
    return gamma, decoded.force(P, gamma, decoded.moduli(muscle)[LEVEL])


def gas_fit(muscle: str, limit: float) -> Fit:
    """F_{G+t} alone over contractions up to ``limit``."""
    gamma, F = curve(muscle, limit)
    return _fit("F_{G+t}", decoded.gas_and_thickness(decoded.LEVELS[LEVEL], gamma), F)


def range_from_print(muscle: str, printed: float) -> float:
    """The contraction up to which F_{G+t} has the printed R².

    The thesis does not say how far its fit ran. This one printed cell, which no modulus enters, fixes it;
    every other cell of the table is then computed without further choice.
    """
    # R² falls with the range here; beyond 0.9 of free contraction relative residuals blow up.
    low, high = 0.15, 0.95 * decoded.first_root(2e5, decoded.moduli(muscle)[LEVEL])

    def excess(limit: float) -> float:
        return gas_fit(muscle, limit).squared_correlation - printed

    if excess(low) * excess(high) > 0:
        return float("nan")
    return float(brentq(excess, low, high, xtol=1e-6))


def order_fit(muscle: str, limit: float, order: int, convention: str = "stretch") -> Fit:
    """Moduli of one order fitted by Eq. 4.5's relative least squares."""
    gamma, F = curve(muscle, limit)
    G = decoded.gas_and_thickness(decoded.LEVELS[LEVEL], gamma)
    X = decoded.columns(gamma, order, convention)
    return _fit(f"M = {order}", G + X @ least_squares(X, F - G, 1.0 / F), F, order)


def order_table(muscle: str, limit: float, orders: range) -> list[Fit]:
    """F_{G+t}, with the material's moduli (Table 4.1), then with fitted moduli of each order."""
    gamma, F = curve(muscle, limit)
    material = decoded.force(decoded.LEVELS[LEVEL], gamma, MATERIAL, "engineering")
    return [
        gas_fit(muscle, limit),
        _fit("E_k of the material", material, F),
        *(order_fit(muscle, limit, order) for order in orders),
    ]


def tabled_order(muscle: str) -> int:
    """Order of the moduli that the thesis tabulates, which is the decoded curve's own."""
    return int(decoded.moduli(muscle).shape[1])


def least_correlation(own: float, shared: float) -> float:
    """Least R² with the measurement of a curve that has ``shared`` with one whose R² with it is ``own``.

    R² is the squared cosine of the angle between two centred curves, and angles add up at most.
    """
    angle = np.arccos(np.sqrt(own)) + np.arccos(np.sqrt(shared))
    return float(np.cos(min(angle, np.pi / 2.0)) ** 2)


def _fit(model: str, fitted: Array, observed: Array, order: int = 0) -> Fit:
    return Fit(
        model,
        squared_correlation(fitted, observed),
        determination(fitted, observed),
        rmse(fitted, observed),
        order,
    )
