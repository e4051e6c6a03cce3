"""Friction of chapter 4: K_f of each level (Eq. 4.17), f_s by least squares (Fig. 4.20)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.physics.friction import HERTZ
from mpam_calib.thesis import decoded

Array = NDArray[np.float64]


def coulomb_factor(model: Array, measured: Array, sign: Array) -> float:
    """K_f >= 0 that minimises Σ((F(1 + K_f s) − F_exp)/F_exp)² (Eq. 4.17).

    Arrays of one length: friction-free force, measured force (N), direction +1 loading, −1 unloading.
    """
    weight = 1.0 / measured
    column, target = model * sign * weight, (measured - model) * weight
    return max(float(column @ target / (column @ column)), 0.0)


def loop(muscle: str, level: int, limit: float) -> tuple[Array, Array, Array]:
    """Noise-free decoded loop of one level with Table 4.10's Coulomb friction.

    Contraction, force (N) and sign, both branches from 0 to ``limit`` (a fraction of free contraction).
    """
    E = decoded.moduli(muscle)[level]
    P = float(decoded.LEVELS[level])
    one_way = np.linspace(0.0, limit * decoded.first_root(P, E), 400)
    gamma = np.concatenate([one_way, one_way])
    sign = np.repeat([1.0, -1.0], one_way.size)
    F = decoded.force(np.asarray(P), gamma, E)
    return gamma, F * (1.0 + decoded.coulomb_factors()[level] * sign), sign


def strand_misfit(f_s: Array, level: int, limit: float, relative: bool = True) -> Array:
    """Least-square error of the strand-friction model against MPAM1's decoded loop, shape of ``f_s``.

    ``relative`` is the thesis's Σ((F_th − F_exp)/F_exp)² over the points; otherwise N².
    """
    gamma, measured, sign = loop("MPAM1", level, limit)
    P = decoded.LEVELS[level]
    F = decoded.force(P, gamma, decoded.moduli("MPAM1")[level])
    per_unit = decoded.strand_friction(P, gamma, 1.0)
    weight = 1.0 / measured if relative else np.ones_like(measured)
    theory = F + np.asarray(f_s)[:, None] * per_unit * sign
    misfit: Array = np.sum(((theory - measured) * weight) ** 2, axis=-1)
    return misfit


def best_strand_factor(level: int, limit: float, relative: bool = True) -> float:
    """The f_s that minimises :func:`strand_misfit` (it is a parabola in f_s)."""
    f = np.array([0.0, 0.5, 1.0])
    square, slope, _ = np.polyfit(f, strand_misfit(f, level, limit, relative), 2)
    return float(-slope / (2.0 * square))


def matching_strand_factor(level: int) -> float:
    """The f_s whose friction equals Coulomb's (Table 4.10) at zero contraction."""
    P = decoded.LEVELS[level]
    zero = np.asarray(0.0)
    F = decoded.force(P, zero, decoded.moduli("MPAM1")[level])
    return float(decoded.coulomb_factors()[level] * F / decoded.strand_friction(P, zero, 1.0))


def strand_friction_by_area() -> float:
    """Strand friction (N) at γ = 0, 200 kPa, if Eq. 2.40's S_scale were a ratio of areas, not of lengths."""
    P = float(decoded.LEVELS[3])
    lengths = HERTZ * np.cbrt(decoded.E_BR / (P * (1.0 - decoded.NU_S**2)))
    return float(decoded.strand_friction(np.asarray(P), np.asarray(0.0)) / lengths)
