"""Blocked force as a function of the design (thesis Eq. 3.12, 3.16); everything broadcasts, SI units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.physics.kinematics import Shape
from mpam_calib.physics.statics import gas_force, thickness_force

Array = NDArray[np.float64]


def gaylord_force(P: Array, R: Array, alpha: Array) -> Array:
    """Force of the gas on a thin wall at rest length, N: PπR²(2 tan²α − 1)."""
    return gas_force(P, Shape(R, R, np.zeros_like(R), np.tan(alpha) ** 2))


def blocked_force(P: Array, R: Array, t: Array, alpha: Array) -> Array:
    """Blocked force without the braid's term, N (Eq. 3.16): pressure Pa, R and t m, α rad."""
    # At rest length L drops out of the equation, so any length will do.
    shape = Shape(R, R, t, np.tan(alpha) ** 2)
    return gas_force(P, shape) + thickness_force(P, shape)


def braid_loss(P: Array, R: Array, alpha: Array, R_br: Array, n: Array, E_br: float) -> Array:
    """Force lost to the energy in n strands of radius R_br, N: the last term of Eq. 3.12."""
    return np.asarray(4.0 * np.pi * P**2 * R**4 * np.sin(alpha) / (E_br * n * R_br**2 * np.cos(alpha) ** 4))


def volume_ratio(R: Array, t: Array) -> Array:
    """Volume of the bladder over that of the muscle, V_bl/V = (t/R)(2 − t/R) (Eq. 3.14)."""
    return t / R * (2.0 - t / R)


def room_for_strands(R: Array, alpha: Array, R_br: Array, n: Array) -> Array:
    """Share of the circumference that n strands leave free; negative where they do not fit.

    Half of the strands run each way round. One of them, 2 R_br thick and at α from the hoop direction,
    takes 2 R_br / sin α of the circumference 2πR.
    """
    return 1.0 - n * R_br / (2.0 * np.pi * R * np.sin(alpha))
