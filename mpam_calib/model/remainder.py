"""The remainder: what the declared physics leaves, as a smooth surface of inferred, a priori small size.

δ(contraction, pressure, branch) = amplitude · Σ w_i φ_i η_i with η ~ N(0, I): Legendre polynomials along
the contraction × such in pressure × {both branches alike, branches apart}, weights falling with the
degree. (Half-waves would be level at full length, where the blocked force is read.) A second, rougher part
belongs to each stroke alone (:mod:`mpam_calib.posterior.likelihood.bins` carries its kernel); together they
keep the bands honest where the model is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.priors import LogNormal, Parameter
from mpam_calib.model.readings import Readings
from mpam_calib.model.reference import geometric_contraction
from mpam_calib.model.state import Setting

Array = NDArray[np.float64]

DEGREE, PRESSURE_DEGREE, KEPT = 7, 6, 40
MARGIN = 1.25
"""The polynomials span this multiple of the geometric contraction."""
SMOOTH, ROUGH = "remainder_sd_N", "stroke_remainder_sd_N"


def remainder_parameters(setting: Setting, strokes: bool) -> tuple[Parameter, ...]:
    """Amplitudes (N): a priori 0.3 percent of the force scale, and a fifth of that for a single stroke.

    Either may be e⁴ times as large, or as small: where the physics is right nothing widens the bands.
    """
    scale = setting.force_scale
    meaning = "assumed scale of what the simulation may leave out, not its size in these data"
    found = [Parameter(SMOOTH, LogNormal(0.003 * scale, 2.0), meaning)]
    if strokes:
        found.append(Parameter(ROUGH, LogNormal(0.0006 * scale, 2.0), "the same, for one stroke alone"))
    return tuple(found)


@dataclass(frozen=True)
class Remainder:
    """The low-rank basis for one specimen (fixed: it depends on the declaration and its levels only)."""

    geometry_length: float
    span: float
    top_pressure: float
    index: NDArray[np.int64]
    """(k, 3): degree along the contraction, in pressure, branch part (0 alike, 1 apart)"""
    weights: Array

    @staticmethod
    def build(setting: Setting, branches: bool) -> Remainder:
        """The basis for a setting; ``branches`` where rows have a branch at all."""
        degrees = min(PRESSURE_DEGREE, len(setting.levels) - 1) + 1
        grid = np.stack(
            np.meshgrid(np.arange(DEGREE + 1), np.arange(degrees), np.arange(1 + branches), indexing="ij"), -1
        ).reshape(-1, 3)
        weights = 1.0 / ((1.0 + grid[:, 0]) * (1.0 + grid[:, 1]) * (1.0 + grid[:, 2]))
        kept = np.argsort(-weights, kind="stable")[:KEPT]
        grid, weights = grid[kept], weights[kept]
        # Mean square over the span is amplitude²: the square of degree l averages 1/(2l + 1).
        power = weights**2 / ((2.0 * grid[:, 0] + 1.0) * (2.0 * grid[:, 1] + 1.0))
        return Remainder(
            setting.geometry.L0,
            MARGIN * geometric_contraction(setting.geometry),
            setting.top_pressure,
            grid,
            weights / np.sqrt(power.sum()),
        )

    @property
    def size(self) -> int:
        """Number of basis functions."""
        return len(self.weights)

    def columns(self, readings: Readings) -> Array:
        """Basis at the readings, (n, k), for amplitude 1 N."""
        gamma = readings.displacement / self.geometry_length / self.span
        along = _legendre(gamma, self.index[:, 0])
        across = _legendre(readings.pressure / self.top_pressure, self.index[:, 1])
        side = np.where(self.index[:, 2] == 1, readings.sign[:, None], 1.0)
        result: Array = along * across * side * self.weights
        return result

    @property
    def degrees(self) -> int:
        """Number of functions :meth:`along` the contraction."""
        return int(self.index[:, 0].max()) + 1

    def along(self, displacement: Array) -> Array:
        """Basis of a function of the contraction alone, (n, degrees), at displacements (m), for 1 N.

        The same polynomials and weights as the surface's, for what knows neither pressure nor branch.
        """
        degree = np.arange(self.degrees)
        weights = 1.0 / (1.0 + degree)
        weights /= np.sqrt(np.sum(weights**2 / (2.0 * degree + 1.0)))
        basis: Array = weights * _legendre(displacement / self.geometry_length / self.span, degree)
        return basis


def _legendre(share: Array, degree: NDArray[np.int64]) -> Array:
    """Polynomials (n, k) on 0 … 1; beyond, where they would run away, they stay what they are at the edge."""
    vander = np.polynomial.legendre.legvander(np.clip(2.0 * share - 1.0, -1.0, 1.0), int(degree.max()))
    return np.asarray(vander[:, degree])
