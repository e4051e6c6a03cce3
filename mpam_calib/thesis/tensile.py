"""Moduli of a bladder material from a tensile test, the thesis's way (Eq. 4.2-4.4, Table 4.1)."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from mpam_calib.thesis.statistics import determination, least_squares, squared_correlation

Array = NDArray[np.float64]

RANGES = ((0.1, 0.5), (0.1, 1.0), (0.1, 2.0), (0.1, 3.0), (0.1, 5.0))
"""Strain ranges that show how much the moduli depend on them (the thesis prints no range)."""


def ecoflex() -> tuple[Array, Array]:
    """Measured tension of Ecoflex 00-50 (Marechal et al. 2020): engineering strain, stress (Pa)."""
    path = files("mpam_calib.thesis") / "material" / "ecoflex_00_50.csv"
    rows = path.read_text(encoding="utf-8").split()[1:]
    data = np.array([[float(cell) for cell in row.split(",")] for row in rows])
    return data[:, 0], data[:, 1]


@dataclass(frozen=True)
class TensileFit:
    """Moduli E_1..E_M (Pa) of σ = Σ E_k ε^k over a strain range, with both kinds of R²."""

    low: float
    high: float
    moduli: Array
    points: int
    squared_correlation: float
    determination: float


def tensile_fit(strain: Array, stress: Array, low: float, high: float, order: int = 2) -> TensileFit:
    """Least squares of the stress (Pa) on powers 1..order of the strain, without a constant (Eq. 4.4)."""
    inside = (strain >= low) & (strain <= high)
    e, s = strain[inside], stress[inside]
    X = e[:, None] ** np.arange(1, order + 1)
    E = least_squares(X, s)
    return TensileFit(low, high, E, int(inside.sum()), squared_correlation(X @ E, s), determination(X @ E, s))
