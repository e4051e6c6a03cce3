"""Friction terms of the thesis, in newtons."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.physics.kinematics import Rest, radius_inextensible_braid

Array = NDArray[np.float64]

HERTZ = 0.69
"""The printed constant of thesis Eq. 2.42 (0.693 unrounded); kept as printed."""


def strand_friction_per_f_s(P: Array, L: Array, rest: Rest, E_br: float, nu_s: float) -> Array:
    """Strand-on-strand friction for f_s = 1, N (thesis Eq. 2.43, empirical).

    P·2πR0L0·(R0/R)(L0/L)·(1/0.69)·(P(1 − ν_s²)/E_br)^(1/3), R from the inextensible braid (Eq. 2.38).
    Zero at and below zero pressure.
    """
    P = np.maximum(P, 0.0)
    ratio = rest.R0 / radius_inextensible_braid(L, rest) * rest.L0 / L
    hertz = np.cbrt(P * (1.0 - nu_s**2) / E_br) / HERTZ
    return P * 2.0 * np.pi * rest.R0 * rest.L0 * ratio * hertz


def coulomb_factor(K_f: Array, sign: Array, force_sign: Array) -> Array:
    """Factor on the friction-free force F: F + K_f |F| s = F (1 + K_f s sgn F) (thesis Eq. 2.44).

    ``sign`` s is +1 loading, −1 unloading, 0 at rest.
    """
    return 1.0 + K_f * (sign * force_sign)
