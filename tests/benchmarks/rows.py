"""The posterior row by row, for samplers that know nothing of the package: arrays and numbers alone."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """The same posterior row by row: force = (1 + K s)·((P − P_DB) g + X η) + σ ε.

    η = centre + shift·P_DB + root·ξ, fitted at the truth, makes ξ and P_DB nearly independent and of order
    one: the dead-band's column lies in the span of the moduli's, and no sampler is to suffer from that.
    """

    force: Array
    pressure: Array
    sign: Array
    per_pressure: Array
    columns: Array
    centre: Array
    shift: Array
    root: Array
    transform: Array
    """(8, 8): coefficients a_k (Pa/kPa), b_k (Pa) of η."""
    dead_band_sd: float
    pulls_at: float
    friction_scale: float
    noise_prior: tuple[float, float]

    def save(self, path: Path) -> None:
        """To a file of arrays."""
        np.savez(path, **{f.name: getattr(self, f.name) for f in fields(self)})

    @staticmethod
    def load(path: Path) -> Rows:
        """From that file."""
        with np.load(path) as stored:
            return Rows(**{f.name: stored[f.name] for f in fields(Rows)})
