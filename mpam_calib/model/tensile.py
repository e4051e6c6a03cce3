"""The bladder material's tensile test: stress as the same polynomial in the same moduli (thesis Eq. 4.4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.priors import LogNormal, Parameter

Array = NDArray[np.float64]

NOISE, MISFIT = "tensile_noise_sd_Pa", "tensile_remainder_sd_Pa"
STRESS_SCALE = 1e6
"""Pa at a strain of one, as the prior's least scale: above every silicone rubber of the soft-robotics
materials database (Marechal et al. 2020, doi 10.1089/soro.2019.0115)."""
NOISELESS = 1e-6
"""Least noise as a share of the prior's stress: computed readings have none, and would weigh too much."""
HALF_WAVES = 12
GRID_POINTS = 32


def half_waves(position: Array, count: int) -> Array:
    """Half-waves over the range 0 to 1 at positions (n,) in it, (n, count), with falling weights.

    A random function of them has a mean square of 1 over the range.
    """
    j = np.arange(count)
    weights = 1.0 / (1.0 + j)
    weights /= np.sqrt(np.sum(weights**2 * np.where(j > 0, 0.5, 1.0)))
    return np.asarray(np.cos(np.pi * j * position[:, None]) * weights)


@dataclass(frozen=True)
class TensileModel:
    """σ(ε) = Σ E_k e^k + remainder, on a declared range of engineering strain (low, high).

    e is the strain or the stretch 1 + ε, as the simulation declares. ``stiffness`` (Pa at a strain of one)
    scales all priors.
    """

    low: float
    high: float
    order: int
    convention: str
    stiffness: float = STRESS_SCALE

    def powers(self, strain: Array) -> Array:
        """Stress per unit of each modulus, (n, order)."""
        e = strain if self.convention == "engineering" else 1.0 + strain
        return e[:, None] ** np.arange(1, self.order + 1)

    def grid(self) -> Array:
        """Columns on the reference grid of strains, (GRID_POINTS, order)."""
        return self.powers(np.linspace(self.low, self.high, GRID_POINTS))

    @property
    def scale(self) -> float:
        """Prior root mean square of the stress on the grid, Pa."""
        return self.stiffness * float(np.sqrt(np.mean(np.linspace(self.low, self.high, GRID_POINTS) ** 2)))

    def remainder(self, strain: Array) -> Array:
        """Half-waves along the strain range for amplitude 1 Pa, (n, HALF_WAVES)."""
        return half_waves((strain - self.low) / (self.high - self.low), HALF_WAVES)

    def parameters(self) -> tuple[Parameter, ...]:
        """Noise and remainder amplitude, Pa."""
        return (
            Parameter(
                NOISE,
                LogNormal(0.002 * self.scale, 2.0, NOISELESS * self.scale),
                "noise of one stress reading, one sigma",
            ),
            Parameter(
                MISFIT,
                LogNormal(0.005 * self.scale, 2.0),
                "what the polynomial leaves of the stress, one sigma",
            ),
        )


def stiffness_scale(strain: Array, stress: Array) -> float:
    """The priors' scale, Pa at a strain of one, for a test (n,) in the declared range.

    Where the rubber is stiffer than silicones are, it is the secant of its largest stress: the priors of such
    a rubber are those of a softer one in other units.
    """
    top = float(strain.max(initial=0.0))
    return max(STRESS_SCALE, float(np.abs(stress).max(initial=0.0)) / top) if top > 0.0 else STRESS_SCALE
