"""Free contractions: where a curve comes to zero, at a slope that is its own.

A free contraction γ* is the first root of F, read with a noise σ (as a contraction) beside that of the force,
w. To first order its density is that of F there, times how fast F falls:
    p(γ*) = L0 |F′| N(F(γ*); 0, w² + (σ L0 F′)²), with F > 0 short of it,
F′ = dF/dx (N/m). Where a force was recorded along the stroke F′ is known well, and a guide's will do. Where
ends alone were measured F′ is all that tells a steep curve from a flat one: each draw needs its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import CONTRACTION_SD, Model
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.likelihood.points import FREE, Points

Array = NDArray[np.float64]

SLOPE_STEP = 1e-3
"""Contraction step of the slope at a free contraction."""
SHORT_SDS, STEP = 5.0, 0.005
"""Sds of a contraction's noise, and steps of the curves' grid, by which a first root is clearly short."""
COARSE = 4
"""Such steps between the places where every vector is looked at: curves are smooth, and draws that are kept
are looked at more closely."""


class Ends(NamedTuple):
    """Force (B, n), N, and slope (B, n), N/m, at free contractions; log of their weight (B,)."""

    force: Array
    slope: Array
    log_weight: Array


@dataclass(frozen=True)
class Short:
    """Places (m,) short of the least free contraction of each level, and how far (as a contraction)."""

    readings: Readings
    gap: Array

    @staticmethod
    def of(points: Points, model: Model, step: float = STEP) -> Short | None:
        """None where there is no free contraction above 0."""
        assert model.setting is not None
        free = points.take((points.kind == FREE) & ~points.censored)
        if not len(free):
            return None
        level = free.level(model.setting.levels)
        by_size = np.lexsort((free.readings.displacement, level))
        least = by_size[np.unique(level[by_size], return_index=True)[1]]
        L0 = model.setting.geometry.L0
        pressure, measured = free.readings.pressure[least], free.readings.displacement[least] / L0
        grid = np.arange(int(np.ceil(measured.max() / step))) * step
        P, g = (each.ravel() for each in np.meshgrid(pressure, grid, indexing="ij"))
        gap = np.repeat(measured, len(grid)) - g
        inside = gap > STEP
        return Short(Readings.at_rest(P[inside], L0 * g[inside]), gap[inside])

    def take(self, kept: NDArray[np.bool_]) -> Short:
        """Some of the places."""
        return Short(self.readings.take(kept), self.gap[kept])

    def gone(self, force: Array, sd: Array) -> NDArray[np.bool_]:
        """Whether a force (B, m) is gone clearly short (B,), for sds of a contraction's noise (B, 1)."""
        early = (force <= 0.0) & (self.gap > STEP + SHORT_SDS * sd)
        return np.asarray(early.any(axis=1))


@dataclass(frozen=True)
class FreeEnds:
    """The free contractions of one specimen: ``rows`` (n,), which of them are ``seen``, what lies short."""

    model: Model
    rows: Readings
    seen: NDArray[np.bool_]
    short: Short | None

    @staticmethod
    def build(points: Points, model: Model) -> FreeEnds | None:
        """None without any."""
        free = points.take(points.kind == FREE)
        if not len(free):
            return None
        return FreeEnds(model, free.readings, ~free.censored, Short.of(points, model, COARSE * STEP))

    def at(self, values: Mapping[str, Array], moduli: Array, contradicted: bool = False) -> Ends:
        """For values (B, 1) and the moduli's coordinates (B, p); the remainder's own slope is left out.

        Where the simulation contradicts all that was measured, no curve is excluded.
        """
        model, n = self.model, len(self.rows)
        assert model.chain is not None and model.setting is not None
        L0 = model.setting.geometry.L0
        sides = [
            replace(self.rows, displacement=self.rows.displacement + side * SLOPE_STEP * L0)
            for side in (-1.0, 0.0, 1.0)
        ]
        curves = [] if self.short is None else [self.short.readings]
        force = model.chain.force(values, moduli, Readings.join([*sides, *curves]))
        slope = (force[:, 2 * n : 3 * n] - force[:, :n]) / (2.0 * SLOPE_STEP * L0)
        falls = -slope[:, self.seen]
        falls = np.abs(falls) if contradicted else np.maximum(falls, 0.0)
        with np.errstate(divide="ignore"):
            weight = np.log(L0 * falls).sum(axis=1)
        if self.short is not None and not contradicted:
            gone = self.short.gone(force[:, 3 * n :], values[CONTRACTION_SD])
            weight = np.where(gone, -np.inf, weight)
        return Ends(force[:, n : 2 * n], slope, weight)
