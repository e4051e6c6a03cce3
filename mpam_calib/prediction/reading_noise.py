"""What a new reading of the load cell adds to the force, for every posterior draw."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.noise import CORRELATED, FREEDOM, GROWTH, WHITE, grown

Array = NDArray[np.float64]


FURTHEST = 100.0
"""Scales of a heavy-tailed noise beyond which nobody would believe a reading."""


@dataclass(frozen=True)
class ReadingNoise:
    """Noise under N draws: ``values`` name → (N, 1), the force (N) at which a growth of one counts.

    A reading may be the mean of ``averaged`` of the rig's, one number or one for each place (n,): that is
    less white noise, and of what lasts the share ``lasting`` (N, n) of its sd.
    """

    values: Mapping[str, Array]
    force_scale: float
    averaged: Array | float = 1.0
    lasting: Array | float = 1.0

    def sd(self, force: Array) -> Array:
        """Standard deviation (N, ...), N, at forces (N, ...); of heavy-tailed noise, its scale."""
        white = self._white(force.ndim)
        correlated = self._correlated(force.ndim) if CORRELATED in self.values else 0.0
        return np.asarray(np.hypot(white, correlated) * self.growth(force))

    def draw(self, force: Array, rng: np.random.Generator) -> Array:
        """One reading's noise (N, ...), N, at forces (N, ...)."""
        return np.asarray(self.unloaded(force.shape, rng) * self.growth(force))

    def unloaded(self, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        """One reading's noise (N, ...), N, where there is no force."""
        normal = rng.standard_normal(shape)
        white = self._white(len(shape))
        correlated = self._correlated(len(shape)) if CORRELATED in self.values else 0.0
        if FREEDOM not in self.values:
            return np.asarray(np.hypot(white, correlated) * normal)
        dof = np.broadcast_to(self._shaped(FREEDOM, len(shape)), shape)
        tailed = white * np.clip(normal / np.sqrt(rng.chisquare(dof) / dof), -FURTHEST, FURTHEST)
        if CORRELATED in self.values:
            tailed = tailed + correlated * rng.standard_normal(shape)
        return np.asarray(tailed)

    def growth(self, force: Array) -> Array | float:
        """Factor on that noise at forces (N, ...)."""
        if GROWTH not in self.values:
            return 1.0
        return grown(self._shaped(GROWTH, force.ndim), force, self.force_scale)

    def _white(self, dimensions: int) -> Array:
        return np.asarray(self._shaped(WHITE, dimensions) / np.sqrt(self.averaged))

    def _correlated(self, dimensions: int) -> Array:
        return np.asarray(self._shaped(CORRELATED, dimensions) * self.lasting)

    def _shaped(self, name: str, dimensions: int) -> Array:
        return self.values[name].reshape(-1, *(1,) * (dimensions - 1))
