"""What static points add to the collapsed posterior: force maps, blocked forces and free contractions."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import CONTRACTION_SD, Model
from mpam_calib.model.noise import FREEDOM, GROWTH, WHITE
from mpam_calib.posterior.density.added import Added, Values, fill, growth
from mpam_calib.posterior.density.free_ends import FreeEnds
from mpam_calib.posterior.density.guide import Guide
from mpam_calib.posterior.density.piece import white_piece
from mpam_calib.posterior.density.slack import Slack
from mpam_calib.posterior.likelihood.points import FREE, Points
from mpam_calib.posterior.likelihood.sites import FreeRows, Sites

Array = NDArray[np.float64]


@dataclass(frozen=True)
class PointShare:
    """The share of a model's points; ``floor`` in N."""

    model: Model
    points: Points
    guide: Guide
    floor: float

    def at(self, values: Values) -> Added:
        """What they add for values (B, 1) by name."""
        assert self.model.chain is not None
        points, n = self.points, len(self.points)
        terms = self.model.chain.terms(values, points.readings, self.guide.points, self.guide.point_echo)
        fixed, columns = terms.fixed, terms.columns
        moduli, ends = self.model.moduli_of(values), None
        if moduli is not None:
            if self._free_ends is not None:
                ends = self._free_ends.at(values, moduli, self.guide.contradicted)
            fixed, columns = fixed + np.einsum("bnp,bp->bn", columns, moduli), np.zeros_like(columns)
        B = len(values[WHITE])
        design = np.zeros((B, n, sum(self.model.linear_sizes)))
        fill(self.model, design, slice(None), values, columns, self._remainder)
        at_zero = points.kind == FREE
        if ends is not None:
            fixed[:, at_zero] = ends.force
        variance = self._variance(values, None if ends is None else ends.slope)
        residual = np.broadcast_to(points.force - fixed, (B, n))
        seen, slack, free = ~points.censored, None, None
        if points.censored.any():
            rows = points.censored
            slack = Slack(
                np.broadcast_to(fixed, (B, n))[:, rows],
                design[:, rows],
                np.tile(np.where(at_zero[rows], 0.0, self.floor), (B, 1)),
                np.sqrt(variance[:, rows]),
            )
        design, residual, spread = design[:, seen], residual[:, seen], variance[:, seen]
        if FREEDOM in values:
            scale = np.sqrt(spread)
            noise = None if self.guide.point_noise is None else self.guide.point_noise[seen]
            sites = Sites.at(noise, scale, values[FREEDOM][:, 0])
            spread = spread * sites.spread
            residual = residual - scale * sites.shift
            free = FreeRows(design / spread[..., None], residual / spread, scale, sites)
        piece = white_piece(design, residual, spread)
        if ends is not None:
            piece = piece._replace(constant=piece.constant - 2.0 * ends.log_weight)
        return Added(piece, slack, free)

    @cached_property
    def _remainder(self) -> Array | None:
        return None if self.model.remainder is None else self.model.remainder.columns(self.points.readings)

    @cached_property
    def _free_ends(self) -> FreeEnds | None:
        return FreeEnds.build(self.points, self.model) if self.model.coordinates_sampled else None

    def _variance(self, values: Values, slope: Array | None) -> Array:
        """Variance (B, n), N², of the readings.

        ``slope`` (N/m) is that of the draws at their free contractions; None: the guide's stands in for it.
        """
        points = self.points
        variance = np.broadcast_to(values[WHITE] ** 2, (len(values[WHITE]), len(points))).copy()
        if GROWTH in values:
            force = points.force if self.guide.points is None else self.guide.points
            variance *= growth(self.model, values, force) ** 2
        at_zero = points.kind == FREE
        if at_zero.any():
            assert self.model.setting is not None
            if slope is None:
                slope = (np.zeros(len(points)) if self.guide.slope is None else self.guide.slope)[at_zero]
            falls = self.model.setting.geometry.L0 * slope
            variance[:, at_zero] += (values[CONTRACTION_SD] * falls) ** 2
        return variance
