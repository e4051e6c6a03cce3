"""What the simulation may miss at pressures below or above all recorded levels.

Up to the outer levels that is the fitted remainder, whose polynomials in pressure say nothing beyond them.
Below the lowest it goes on in proportion to the pressure, without which nothing pulls; above several levels
as it is at the highest; above a single one, which cannot tell, in proportion as well, as a misfit of the
gas's pull would. To each draw a random function of the contraction is added that nothing has been learnt
about: of the remainder's own size one level's spacing away, and in proportion to the distance. Where the
moduli are free at each level, what they change by is another, between the levels as well
(:mod:`~mpam_calib.prediction.free_moduli`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.readings import Readings
from mpam_calib.model.reference import rest_of
from mpam_calib.model.remainder import SMOOTH, Remainder
from mpam_calib.physics.kinematics import SHAPES
from mpam_calib.physics.statics import gas_force
from mpam_calib.posterior.draws import Draws

Array = NDArray[np.float64]

STREAM = 14
"""Tells these random numbers from all others of a seed."""
KEPT_SD = 0.5
"""Of what fades below the lowest level: within two of it all may stay, as a dead-band's share does."""
TURNED = 2.0
"""Of the force below the lowest level, what may be missed of it: with less its sign could never turn."""


@dataclass(frozen=True)
class Beyond:
    """N draws of what comes to the model's force (N) beyond the levels (Pa).

    ``pull`` (N/Pa) is the gas's at full length; ``size`` (N, 1), N, the remainder's sd and ``eta`` (N, k) its
    coordinates. ``below`` and ``above`` (N, degrees) are those of the new functions, alike for both branches;
    ``kept`` (N, 1) says how much of what fades below the lowest level stays (one) or turns over, too;
    ``unknown`` (N, 2 + levels) says how free moduli change: below, above, and about each level.
    """

    remainder: Remainder
    levels: Array
    pull: float
    size: Array
    eta: Array
    below: Array
    above: Array
    kept: Array
    unknown: Array

    @classmethod
    def draw(cls, model: Model, draws: Draws, seed: int) -> Beyond | None:
        """New functions for every draw; None where the model has no remainder."""
        if model.remainder is None or model.setting is None:
            return None
        geometry, kinematics = model.setting.geometry, model.setting.simulation.kinematics
        full = SHAPES[kinematics](np.array(geometry.L0), rest_of(geometry))
        p, q, _ = model.linear_sizes
        rng, count, levels = np.random.default_rng([seed, STREAM]), len(draws), model.setting.levels
        below, above = rng.standard_normal((2, count, model.remainder.degrees))
        return cls(
            remainder=model.remainder,
            levels=levels,
            pull=abs(gas_force(np.array(1.0), full).item()),
            size=draws.values[SMOOTH],
            eta=draws.eta[:, p : p + q],
            below=below,
            above=above,
            kept=KEPT_SD * rng.standard_normal((count, 1)),
            unknown=np.hstack([rng.standard_normal((count, k)) for k in (2, len(levels))]),
        )

    def force(self, readings: Readings, known: Array, moduli: Array | None = None) -> Array:
        """Force (N, n) that comes to the model's, ``known`` (N, n), at readings (n,).

        ``moduli`` (N, n) is what free moduli change by. Without it 0 from the lowest to the highest level.
        """
        added = np.zeros_like(known) if moduli is None else moduli.copy()
        P, lowest, highest = readings.pressure, self.levels[0], self.levels[-1]
        below, above = np.flatnonzero((lowest > P) & (P >= 0.0)), np.flatnonzero(highest < P)
        if len(below):
            added[:, below] = self._below(readings.take(below), known[:, below], added[:, below])
        if len(above) and highest > 0.0:
            added[:, above] += self._above(readings.take(above))
        return added

    def _above(self, readings: Readings) -> Array:
        P, highest = readings.pressure, self.levels[-1]
        added: Array = self._along(self.above, readings) * ((P - highest) / self._spacing)
        if len(self.levels) == 1:
            added += self._fitted(readings) * (P / highest - 1.0)
        return added

    def _below(self, readings: Readings, known: Array, moduli: Array) -> Array:
        P, lowest = readings.pressure, self.levels[0]
        share = P / lowest
        edge = self._fitted(replace(readings, pressure=np.full(len(P), lowest)))
        missed = self._along(self.below, readings) * ((lowest - P) / self._spacing)
        # What a wall or the gas is wrong by fades with the pressure; what a dead-band takes does not.
        missed += self.kept * edge * (1.0 - share) + moduli
        added: Array = share * edge - self._fitted(readings)
        # Without pressure nothing pulls: what is missed is at most the gas's whole pull. Where a dead-band or
        # a gauge's offset has made up for a misfit the model pulls even there: all of that may be wrong.
        most = np.maximum(self.pull * P, TURNED * np.abs(known + added))
        added += missed * most / np.maximum(np.hypot(missed, most), np.finfo(float).tiny)
        return added

    @property
    def _spacing(self) -> float:
        """Mean distance of neighbouring levels (Pa), of a single one that from no pressure."""
        if len(self.levels) == 1:
            return float(self.levels[0])
        return float(self.levels[-1] - self.levels[0]) / (len(self.levels) - 1)

    def _fitted(self, readings: Readings) -> Array:
        """The fitted remainder (N, n), N, as its polynomials have it."""
        force: Array = self.size * (self.eta @ self.remainder.columns(readings).T)
        return force

    def _along(self, coordinates: Array, readings: Readings) -> Array:
        """Random functions of the contraction (N, n), N."""
        force: Array = self.size * (coordinates @ self.remainder.along(readings.displacement).T)
        return force
