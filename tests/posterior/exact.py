"""The exact posterior of a small specimen: quadrature over (K_f, noise), the moduli analytic.

Built on the slow twin's force and prior alone; priors of K_f and the noise are written out again.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from model import build
from scipy import stats

from mpam_calib.model.blueprint import Blueprint, draw_blueprint
from mpam_calib.posterior.density.target import build_target, predict_force
from mpam_calib.specimen.recording import Specimen

from .reference import Twin

Array = np.ndarray
NOISE = 0.2
NAMES = ["a_1", "a_2", "b_1", "b_2", "K_f", "noise_sd_N"]


@dataclass(frozen=True)
class Exact:
    """Means and sds in lab units, in the order of NAMES."""

    mean: Array
    sd: Array


def small_specimen(seed: int = 0) -> tuple[Specimen, Blueprint]:
    """72 rows of three loops, linear law of order 2, Coulomb friction; forces from the model itself."""
    rng = np.random.default_rng(seed)
    recorded = build.loops((100.0, 150.0, 200.0), 12.0, 12)
    made = build.with_force(build.specimen({"law": "linear", "order": 2}, recorded), np.full(72, 20.0))
    blueprint = draw_blueprint(made, build.PLAIN)
    model = build_target(made, blueprint).model
    values = {"K_f": np.array([[0.06]]), "noise_sd_N": np.array([[NOISE]])}
    eta = 0.2 * rng.standard_normal((1, 4))
    force = predict_force(model, values, eta, build.rows_of(recorded))[0]
    return build.with_force(made, force + NOISE * rng.standard_normal(72)), blueprint


def exact_posterior(made: Specimen, blueprint: Blueprint, points: int = 61) -> Exact:
    """A grid over all that is within e^-25 of the top, narrowed down in four passes."""
    twin = Twin(made, blueprint)
    K, s = np.linspace(0.0, 0.3, 31), np.exp(np.linspace(np.log(0.05), np.log(1.0), 31))
    for size in (31, 31, 31, points):
        inside = _log_weight(twin, K, s)[0] > -25.0
        K = _zoom(K, inside.any(axis=1), size)
        s = _zoom(s, inside.any(axis=0), size)
    return _moments(twin, K, s)


def _zoom(grid: Array, inside: Array, size: int) -> Array:
    """A grid over the marked points and one more on each side."""
    marked = np.flatnonzero(inside)
    return np.linspace(grid[max(marked[0] - 1, 0)], grid[min(marked[-1] + 1, len(grid) - 1)], size)


def _log_weight(twin: Twin, K: Array, s: Array) -> tuple[Array, Array, Array]:
    """Log posterior density (0 at its top), and the coefficients' conditional means and covariances."""
    log_weight = np.empty((len(K), len(s)))
    centre = np.empty((len(K), len(s), 4))
    spread = np.empty((len(K), len(s), 4))
    # Force and columns are linear in K_f: two evaluations give them all.
    ends = [twin.dense({"K_f": k, "noise_sd_N": 1.0}) for k in (0.0, 1.0)]
    root = ends[0].root
    for i, k in enumerate(K):
        f, A = ((1.0 - k) * x + k * y for x, y in ((ends[0].f, ends[1].f), (ends[0].A, ends[1].A)))
        w, U = np.linalg.eigh(A @ A.T)
        r, B = U.T @ (ends[0].y - f), U.T @ A
        total = np.maximum(w, 0.0) + s[:, None] ** 2
        log_weight[i] = -0.5 * np.sum(r**2 / total + np.log(total), axis=1)
        centre[i] = (r / total) @ B @ root.T
        covariance = np.eye(4) - np.einsum("na,jn,nb->jab", B, 1.0 / total, B)
        spread[i] = np.einsum("qa,jab,qb->jq", root, covariance, root)
    log_weight += stats.halfnorm(scale=0.2).logpdf(K)[:, None]
    log_weight += stats.lognorm(0.7, scale=NOISE).logpdf(s)
    return log_weight - log_weight.max(), centre, spread


def _moments(twin: Twin, K: Array, s: Array) -> Exact:
    log_weight, centre, spread = _log_weight(twin, K, s)
    # Spacing is even; all that matters lies inside, so that the ends' halves do not.
    weight = np.exp(log_weight)
    weight /= weight.sum()
    grid = np.stack(np.meshgrid(K, s, indexing="ij"), axis=-1)
    centre = np.concatenate([centre, grid], axis=-1)
    mean = np.einsum("ij,ijk->k", weight, centre)
    variance = np.einsum("ij,ijk->k", weight, (centre - mean) ** 2)
    variance[:4] += np.einsum("ij,ijk->k", weight, spread)
    # a in Pa/kPa, b in Pa.
    unit = np.array([1e3, 1e3, 1.0, 1.0, 1.0, 1.0])
    return Exact(mean * unit, np.sqrt(variance) * unit)


def failures(exact: Exact, draws: Array, effective: Array) -> list[str]:
    """What draws (N, 6) of effective sizes (6,) get wrong: a mean by 4 Monte Carlo errors, a sd by 5 %."""
    found = []
    for i, name in enumerate(NAMES):
        error = exact.sd[i] / np.sqrt(effective[i])
        if abs(draws[:, i].mean() - exact.mean[i]) > 4.0 * error:
            found.append(f"mean of {name}")
        if abs(draws[:, i].std() / exact.sd[i] - 1.0) > 0.05:
            found.append(f"sd of {name}")
    return found
