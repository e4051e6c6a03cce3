"""The muscle's equations once more, for one scalar at a time, in SI units and plain Python.

Written from the thesis's equations and the definition of the declared simulation, without the package.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Tube:
    """Length, outer radius, wall (m) and braid angle (rad, from the hoop direction) at rest."""

    L0: float
    R0: float
    t0: float
    alpha0: float


def tan2(m: Tube, L: float) -> float:
    """T = tan² α with sin α = L/B, B = L0/sin α0."""
    alpha = math.asin(L / (m.L0 / math.sin(m.alpha0)))
    return math.tan(alpha) ** 2


def radius(m: Tube, L: float, kinematics: str) -> float:
    """R by Eq. 2.10 or Eq. 4.16."""
    if kinematics == "inextensible_braid":
        B = m.L0 / math.sin(m.alpha0)
        turns = B * math.cos(m.alpha0) / (2.0 * math.pi * m.R0)
        return math.sqrt(B**2 - L**2) / (2.0 * math.pi * turns)
    # L0 (2 R0 t0 − t0²) = L (2 R t0 − t0²)
    return (m.L0 * (2.0 * m.R0 * m.t0 - m.t0**2) / L + m.t0**2) / (2.0 * m.t0)


def wall(m: Tube, L: float, R: float, kinematics: str) -> float:
    """t = t0, or the smaller root of L (2Rt − t²) = L0 (2 R0 t0 − t0²)."""
    if kinematics == "constant_thickness":
        return m.t0
    section = m.L0 * (2.0 * m.R0 * m.t0 - m.t0**2) / L
    # t² − 2Rt + section = 0; written so that nothing cancels.
    return section / (R + math.sqrt(R**2 - section))


def gas(P: float, R: float, T: float) -> float:
    return P * math.pi * R * R * (2.0 * T - 1.0)


def thickness(P: float, R: float, t: float, T: float) -> float:
    return P * math.pi * ((2.0 * R * t - t * t) - 2.0 * t * R * T)


def per_modulus(m: Tube, L: float, R: float, t: float, T: float, k: int, strain: str) -> float:
    """Force for E_k = 1 Pa: π(2Rt − t²) z^k − 2πRtT x^k."""
    z, x = L / m.L0, R / m.R0
    if strain == "engineering":
        z, x = z - 1.0, x - 1.0
    return math.pi * (2.0 * R * t - t * t) * z**k - 2.0 * math.pi * R * t * T * x**k


def static(m: Tube, P: float, gamma: float, E: list[float], kinematics: str, strain: str) -> float:
    """The declared simulation's force without friction, for moduli E_1, E_2, … (Pa)."""
    L = m.L0 * (1.0 - gamma)
    R = radius(m, L, kinematics)
    t, T = wall(m, L, R, kinematics), tan2(m, L)
    force = gas(P, R, T) + thickness(P, R, t, T)
    for k, modulus in enumerate(E, start=1):
        force += modulus * per_modulus(m, L, R, t, T, k, strain)
    return force


def strand_friction(m: Tube, P: float, gamma: float, E_br: float, nu: float) -> float:
    """|F_f| for f_s = 1 by Eq. 2.43 as printed."""
    root = math.sqrt(1.0 - math.sin(m.alpha0) ** 2 * (1.0 - gamma) ** 2)
    surface = 2.0 * math.pi * m.R0 * m.L0 * math.cos(m.alpha0) / root / (1.0 - gamma)
    return P * surface / 0.69 * (P * (1.0 - nu**2) / E_br) ** (1.0 / 3.0)


def braid_energy(m: Tube, P: float, L: float, E_br: float, R_br: float, n: int) -> float:
    """F_br by Eq. 2.25 as printed."""
    B = m.L0 / math.sin(m.alpha0)
    two_pi_N = B * math.cos(m.alpha0) / m.R0
    area = math.pi * R_br**2
    return L / (E_br * area * n) * 4.0 * math.pi**2 * P**2 * B**3 / two_pi_N**4


def prior_root(columns: list[list[float]], scale: float) -> list[list[float]]:
    """A root R (q × q) of the coefficients' prior covariance, R Rᵀ = scale² · N/q · (GᵀG)⁻¹.

    ``columns`` is G (N grid points × q coefficients). With it the root-mean-square force on the grid is
    ``scale`` in the mean over the prior: trace(G R Rᵀ Gᵀ)/N = scale².
    """
    import numpy as np

    G = np.array(columns)
    norm = np.sqrt((G**2).sum(axis=0))
    _, s, Vt = np.linalg.svd(G / norm, full_matrices=False)
    root = scale * math.sqrt(G.shape[0] / G.shape[1]) * (Vt.T / s) / norm[:, None]
    return [[float(x) for x in row] for row in root]
