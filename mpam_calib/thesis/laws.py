"""Pressure laws of the moduli: the thesis's way (each E_k alone) and jointly to the force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from mpam_calib.thesis import decoded
from mpam_calib.thesis.statistics import determination, least_squares, rmse
from mpam_calib.thesis.tables import table
from mpam_calib.units import KPA

Array = NDArray[np.float64]

P_KPA = decoded.LEVELS / KPA
GRID: Array = np.arange(59, dtype=np.float64) * 0.005
"""Contractions of the joint fits: 0 (0.005) 0.29."""


def line(E: Array) -> tuple[float, float, float]:
    """Eq. 4.7 by ordinary least squares: a (Pa/kPa), b (Pa), R² of one modulus at the five levels."""
    a, b = np.polyfit(P_KPA, E, 1)
    return float(a), float(b), determination(a * P_KPA + b, E)


def printed_line() -> Array:
    """Moduli of MPAM1 by Table 4.4's printed a and b, Pa, shape (5, 4)."""
    a, b = table("4.4").values()
    moduli: Array = a * P_KPA[:, None] + b
    return moduli


def full_line() -> Array:
    """The same line with every digit, fitted to Table 4.3 (corrected), Pa, shape (5, 4)."""
    return np.stack([np.polyval(line(E)[:2], P_KPA) for E in decoded.moduli("MPAM1").T], axis=1)


def double_exponential(constants: Array, pressure_kPa: Array) -> Array:
    """Eq. 4.8 for constants (4, M) in the rows c, d, w, z: Pa, shape (pressures, M)."""
    c, d, w, z = constants
    P = pressure_kPa[:, None]
    moduli: Array = c * np.exp(d * P) + w * np.exp(z * P)
    return moduli


@dataclass(frozen=True)
class Exponential:
    """A least-squares fit of Eq. 4.8 to one modulus: c, w (Pa), d, z (1/kPa), R²."""

    c: float
    d: float
    w: float
    z: float
    r2: float


def exponential_at(E: Array, d: float, z: float) -> Exponential:
    """The best c and w for given rates (they enter linearly)."""
    X = np.exp(np.outer(P_KPA, [d, z]))
    c, w = least_squares(X, E)
    return Exponential(float(c), d, float(w), z, determination(X @ np.array([c, w]), E))


def exponential(E: Array, start: tuple[float, float], z_fixed: bool = False) -> Exponential:
    """Eq. 4.8 fitted to one modulus from starting rates (d, z), 1/kPa; ``z_fixed`` holds z."""
    d0, z0 = start

    def misfit(q: Array) -> float:
        return 1.0 - exponential_at(E, q[0] * d0, z0 if z_fixed else q[1] * z0).r2

    found = minimize(
        misfit,
        np.ones(1 if z_fixed else 2),
        method="Nelder-Mead",
        options={"xatol": 1e-9, "fatol": 1e-16, "maxiter": 4000},
    )
    return exponential_at(E, float(found.x[0]) * d0, z0 if z_fixed else float(found.x[1]) * z0)


def force_error(muscle: str, moduli: Array) -> Array:
    """Blocked force by other moduli (5, M) minus the decoded one, N, at each level."""
    return decoded.force(decoded.LEVELS, np.asarray(0.0), moduli) - decoded.blocked_forces(muscle)


def blocked_line(muscle: str) -> Array:
    """Slope (N/kPa) and intercept (N) of the line through the decoded blocked forces, (2,)."""
    return np.polyfit(P_KPA, decoded.blocked_forces(muscle), 1)


@dataclass(frozen=True)
class Joint:
    """A law fitted to the force of several levels at once: residual (N), R² = 1 − SSE/SST, constants."""

    law: str
    order: int
    levels: int
    n_constants: int
    rmse_N: float
    r2: float
    rates: tuple[float, ...] = ()


def joint(
    muscle: str,
    order: int,
    basis: Array,
    law: str,
    levels: slice = slice(None),
    rates: tuple[float, ...] = (),
) -> Joint:
    """Moduli E_k(P) = Σ_j β_kj basis_j(P), fitted by least squares to the decoded force on ``GRID``.

    ``basis`` has shape (5, functions).
    """
    X, target, F = _stacked(muscle, order, basis, levels)
    fitted = F - target + X @ least_squares(X, target)
    return Joint(
        law,
        order,
        len(range(*levels.indices(decoded.LEVELS.size))),
        X.shape[1] + len(rates),
        rmse(fitted, F),
        determination(fitted, F),
        rates,
    )


def linear_basis() -> Array:
    """1 and P (in 100 kPa), shape (5, 2)."""
    return np.stack([np.ones_like(P_KPA), P_KPA / 100.0], axis=1)


def joint_exponential(muscle: str, order: int) -> Joint:
    """a + b exp(dP) with one d (1/kPa) for all moduli, the rate found by a search."""

    def basis(q: Array) -> Array:
        return np.stack([np.ones_like(P_KPA), np.exp(q[0] * P_KPA)], axis=1)

    rates = _best_rates(muscle, order, basis, [[0.002], [-0.005], [0.005], [-0.02]])
    return joint(muscle, order, basis(np.array(rates)), "a + b exp(dP), common d", rates=tuple(rates))


def joint_double_exponential(muscle: str, order: int) -> Joint:
    """c exp(dP) + w exp(zP) with rates (1/kPa) shared by all moduli."""

    def basis(q: Array) -> Array:
        return np.exp(np.outer(P_KPA, q))

    starts = [[0.002, -0.03], [0.005, -0.005], [0.001, -0.1], [0.01, 0.002]]
    found = tuple(sorted(_best_rates(muscle, order, basis, starts), reverse=True))
    return joint(muscle, order, basis(np.array(found)), "c exp(dP) + w exp(zP), common d, z", rates=found)


def _stacked(muscle: str, order: int, basis: Array, levels: slice) -> tuple[Array, Array, Array]:
    """Columns, target (force without gas and thickness) and force of the chosen levels, stacked."""
    X = decoded.columns(GRID, order)
    force = decoded.curves(muscle, GRID)
    gas = decoded.gas_and_thickness(decoded.LEVELS[:, None], GRID)
    columns = np.concatenate([np.hstack([value * X for value in row]) for row in basis[levels]])
    return columns, (force - gas)[levels].ravel(), force[levels].ravel()


def _best_rates(
    muscle: str, order: int, basis: Callable[[Array], Array], starts: list[list[float]]
) -> list[float]:
    """The rates (1/kPa) whose basis leaves the smallest residual, searched from several starts."""

    def misfit(q: Array) -> float:
        X, target, _ = _stacked(muscle, order, basis(q / 100.0), slice(None))
        return rmse(X @ least_squares(X, target), target)

    runs = [minimize(misfit, np.array(s) * 100.0, method="Nelder-Mead") for s in starts]
    best = min(runs, key=lambda r: float(r.fun))
    return [float(v) / 100.0 for v in best.x]
