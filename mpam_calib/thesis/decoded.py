"""The published calibration as it has to be read: stretches, R of Eq. 4.16, moduli of Tables 4.3 and 4.7.

The measured curves are lost. With strains (L/L0 − 1, R/R0 − 1), as Eq. 4.5 prints them, the tabled moduli
give down to −3 kN; with stretches (L/L0, R/R0) they give the muscle back. What comes out is called
reconstructed, never measured.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mpam_calib.physics.friction import strand_friction_per_f_s
from mpam_calib.physics.kinematics import Rest, Shape, shape_constant_thickness
from mpam_calib.physics.statics import gas_force, modulus_columns, thickness_force
from mpam_calib.prediction import protocol
from mpam_calib.thesis.tables import number, table
from mpam_calib.units import DEG, GPA, KPA, MM

Array = NDArray[np.float64]

L0, R0, T0, ALPHA0 = 50 * MM, 3 * MM, 0.7 * MM, 72 * DEG
"""The muscles as built (thesis 4.2.2, 4.6.2.1): m, m, m, rad."""
F_S, E_BR, NU_S = 0.15, 2.0 * GPA, 0.33
"""Strand friction of chapter 4: f_s, Young's modulus (Pa) and Poisson's ratio of a strand."""
LEVELS = protocol.LEVELS
"""The five pressures of the loops, Pa."""
MUSCLES = {"MPAM1": "4.3", "MPAM2": "4.7"}
"""Which table holds a muscle's moduli."""


def rest() -> Rest:
    """Geometry at rest of both muscles."""
    return Rest(np.asarray(L0), np.asarray(R0), np.asarray(T0), np.asarray(ALPHA0))


def shape_at(gamma: Array) -> Shape:
    """Geometry at contraction γ by Eq. 4.15 and 4.16 (constant volume, constant thickness)."""
    return shape_constant_thickness(L0 * (1.0 - np.asarray(gamma, dtype=float)), rest())


def gas_and_thickness(P: Array, gamma: Array) -> Array:
    """F_{G+t}, N (Eq. 3.16 at the instantaneous R and α); broadcasts P (Pa) against γ."""
    shape = shape_at(gamma)
    return gas_force(P, shape) + thickness_force(P, shape)


def columns(gamma: Array, order: int, convention: str = "stretch") -> Array:
    """Force per unit of each E_k, m² (Eq. 4.10); shape (*γ, order)."""
    return modulus_columns(shape_at(gamma), rest(), convention, order)


def corrected_e4_50() -> float:
    """E_4 of MPAM1 at 50 kPa (Pa) from Table 4.4's intercept; the print repeats E_2 there.

    The intercept of a least-squares line is a fixed linear combination of the five moduli, so that it
    and four of them give the fifth.
    """
    printed = table("4.3")
    x = LEVELS / KPA
    weight = 1.0 / x.size - x.mean() * (x - x.mean()) / np.sum((x - x.mean()) ** 2)
    e4 = printed.values()[:, 3]
    return float((number(table("4.4").text("b", "E_4")) - weight[1:] @ e4[1:]) / weight[0])


def moduli(muscle: str, corrected: bool = True) -> Array:
    """Moduli E_k of Table 4.3 or 4.7, Pa, shape (5 levels, M); ``corrected`` replaces MPAM1's E_4(50 kPa)."""
    values = table(MUSCLES[muscle]).values()
    if corrected and muscle == "MPAM1":
        values[0, 3] = corrected_e4_50()
    return values


def force(P: Array, gamma: Array, E: Array, convention: str = "stretch") -> Array:
    """Friction-free force, N (Eq. 4.6, 4.10) for moduli E of shape (..., M) that broadcast against γ."""
    bladder: Array = np.sum(columns(gamma, E.shape[-1], convention) * E, axis=-1)
    return gas_and_thickness(P, gamma) + bladder


def first_root(P: float, E: Array, limit: float = 0.6) -> float:
    """Free contraction: first root of F(γ); 0 where F(0) <= 0, nan where F > 0 up to ``limit``."""
    grid = np.linspace(0.0, limit, 1201)
    f = force(np.asarray(P), grid, E)
    if f[0] <= 0.0:
        return 0.0
    below = np.flatnonzero(f < 0.0)
    if below.size == 0:
        return float("nan")
    i = int(below[0])
    return float(brentq(lambda g: float(force(np.asarray(P), np.asarray(g), E)), grid[i - 1], grid[i]))


def free_contractions(muscle: str) -> Array:
    """Free contraction at each level, (5,)."""
    return np.array([first_root(float(P), E) for P, E in zip(LEVELS, moduli(muscle), strict=True)])


def strand_friction(P: Array, gamma: Array, f_s: float = F_S) -> Array:
    """|F_f| of Eq. 4.14, N."""
    L = L0 * (1.0 - np.asarray(gamma, dtype=float))
    return f_s * strand_friction_per_f_s(P, L, rest(), E_BR, NU_S)


def coulomb_factors() -> Array:
    """K_f of Table 4.10, one for each level."""
    values: Array = table("4.10").values()[0]
    return values


def curves(muscle: str, contraction: Array) -> Array:
    """Force (5, n), N, along contractions (n,): what Tables 4.3 (corrected) and 4.7 decode to."""
    return force(LEVELS[:, None], contraction, moduli(muscle)[:, None, :])


def blocked_forces(muscle: str) -> Array:
    """Force at γ = 0 at each level, N, (5,)."""
    return curves(muscle, np.zeros(1))[:, 0]


def blocked_ratio() -> Array:
    """MPAM2's blocked force over MPAM1's at each level, (5,)."""
    return blocked_forces("MPAM2") / blocked_forces("MPAM1")


def bladder_force(P: Array, gamma: Array, E: Array) -> Array:
    """F_NL, what the bladder adds to gas and thickness, N; broadcasts like :func:`force`."""
    return force(P, gamma, E) - gas_and_thickness(P, gamma)


def bladder_at_rest(muscle: str) -> Array:
    """F_NL at γ = 0 at each level, N, (5,)."""
    return bladder_force(LEVELS, np.asarray(0.0), moduli(muscle))
