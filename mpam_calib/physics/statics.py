"""Static force terms: pressurised gas, the wall's thickness, the bladder's stress, the strands' energy.

All in newtons, for pressure P in Pa and a :class:`~mpam_calib.physics.kinematics.Shape`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.physics.kinematics import Rest, Shape

Array = NDArray[np.float64]


def gas_force(P: Array, shape: Shape) -> Array:
    """Gaylord's force of the gas on a thin wall: Pπ R² (2T − 1) (first term of thesis Eq. 3.16)."""
    return P * (np.pi * shape.R**2 * (2.0 * shape.T - 1.0))


def thickness_force(P: Array, shape: Shape) -> Array:
    """What the wall's thickness takes from it: Pπ [(2Rt − t²) − 2tRT] (thesis Eq. 2.9, 3.16)."""
    R, t = shape.R, shape.t
    return P * (np.pi * ((2.0 * R * t - t**2) - 2.0 * t * R * shape.T))


def work_lost_at_tips(P: Array, shape: Shape, rest: Rest) -> Array:
    """What two conical ends of 45° take from a cylinder's force, N.

    They lack V = 2π[R0ρ² + 2ρ³/3] of its volume, ρ = R − R0, on which the gas does no work: P dV/dL, with
    dV/dR = 4πRρ and dR/dL = −R T/L (Eq. 2.10) as in :func:`gas_force`.
    """
    return P * 4.0 * np.pi * shape.R**2 * (shape.R - rest.R0) * shape.T / shape.L


def axial_lever(shape: Shape) -> Array:
    """Section of the wall, π(2Rt − t²), m²: what the axial stress acts on (thesis Eq. 4.10)."""
    return np.pi * (2.0 * shape.R * shape.t - shape.t**2)


def hoop_lever(shape: Shape) -> Array:
    """2πRtT, m²: what the hoop stress takes from the force through the braid (thesis Eq. 4.10)."""
    return 2.0 * np.pi * shape.R * shape.t * shape.T


def strains(shape: Shape, rest: Rest, convention: str) -> tuple[Array, Array]:
    """Axial and hoop argument (z, x) of the stress polynomial.

    "engineering": L/L0 − 1, R/R0 − 1 (thesis Eq. 2.13-2.14); "stretch": L/L0, R/R0 (how its tables
    must be read).
    """
    shift = 1.0 if convention == "engineering" else 0.0
    return shape.L / rest.L0 - shift, shape.R / rest.R0 - shift


def modulus_columns(shape: Shape, rest: Rest, convention: str, order: int) -> Array:
    """Force per unit of each modulus E_k, m²; shape (..., order).

    π(2Rt − t²) z^k − 2πRtT x^k for k = 1..order (thesis Eq. 4.10): the bladder's force is this
    times the moduli.
    """
    z, x = strains(shape, rest, convention)
    axial, hoop = axial_lever(shape) * z, hoop_lever(shape) * x
    columns = [axial - hoop]
    for _ in range(order - 1):
        axial, hoop = axial * z, hoop * x
        columns.append(axial - hoop)
    # A few moduli and many readings: products with pressure run along the readings.
    return np.stack(columns).transpose(*range(1, axial.ndim + 1), 0)


def braid_energy_force(P: Array, L: Array, rest: Rest, E_br: float, R_br: float, n: int) -> Array:
    """Force lost to the energy in the stretched strands, N (thesis Eq. 2.25; to be subtracted).

    F_br = L/(E_br A_br n) · 4π²P²B³/(2πN)⁴ with a strand's length B and winding 2πN.
    """
    area = np.pi * R_br**2
    return L / (E_br * area * n) * 4.0 * np.pi**2 * P**2 * rest.strand**3 / rest.winding**4


def strand_strain(P: Array, L: Array, rest: Rest, E_br: float, R_br: float, n: int) -> Array:
    """Strain of a strand under the tension 2πPBL/(n (2πN)²), whose energy is that of thesis Eq. 2.25."""
    return 2.0 * np.pi * P * rest.strand * L / (n * rest.winding**2) / (E_br * np.pi * R_br**2)
