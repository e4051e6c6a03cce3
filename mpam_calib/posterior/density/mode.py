"""Modes of the collapsed posterior and the curvature there, by batched finite differences."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mpam_calib.model.noise import WHITE
from mpam_calib.model.remainder import SMOOTH
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.density.batch import batch_size
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.pool import held_target, workers

Array = NDArray[np.float64]

GRADIENT_STEP = 2e-5
BATCH = 64
"""Points of any other density evaluated at once."""
TRIED, CLIMBED = 256, 4
"""Prior draws that are looked at, and the best of them that climbs start from."""
LOUD = 3.0
"""Prior sds of the noise under which the draws are compared."""
HOPELESS = 15.0
"""Nats below the best at which a climb has got stuck rather than found a mode."""
LOOSEST = 0.2
"""Smallest precision that is believed; the prior's own is 1."""


class Density(Protocol):
    """A log posterior density in sampler coordinates; not normalised: its integral is the evidence."""

    def log_posterior(self, u: Array) -> Array:
        """Log density (B,) at points (B, d)."""


@dataclass(frozen=True)
class Mode:
    """A local maximum: sampler coordinates (d,), log posterior there, covariance (d, d)."""

    u: Array
    log_posterior: float
    covariance: Array

    @property
    def log_evidence(self) -> float:
        """Laplace's approximation of the log evidence (:mod:`mpam_calib.posterior.evidence` integrates)."""
        _, log_det = np.linalg.slogdet(self.covariance)
        return float(self.log_posterior + 0.5 * len(self.u) * np.log(2.0 * np.pi) + 0.5 * log_det)


def evaluate(target: Density, u: Array) -> Array:
    """Log posterior (n,) in batches."""
    size = batch_size(target) if isinstance(target, Collapsed) else BATCH
    parts = [target.log_posterior(u[i : i + size]) for i in range(0, len(u), size)]
    return np.concatenate(parts)


def climb(target: Density, start: Array, steps: int = 200) -> tuple[Array, float]:
    """BFGS from a start (d,): the point reached and its log posterior."""
    d = len(start)
    offsets = np.concatenate([np.zeros((1, d)), np.eye(d), -np.eye(d)]) * GRADIENT_STEP

    def negative(u: Array) -> tuple[float, Array]:
        f = evaluate(target, u + offsets)
        if not np.all(np.isfinite(f)):
            return 1e12, np.zeros(d)
        return -float(f[0]), -(f[1 : d + 1] - f[d + 1 :]) / (2.0 * GRADIENT_STEP)

    found = optimize.minimize(
        negative, start, jac=True, method="BFGS", options={"maxiter": steps, "gtol": 1e-2}
    )
    return np.asarray(found.x), -float(found.fun)


def curvature(target: Density, u: Array, top: float) -> Array:
    """Covariance (d, d) from the Hessian at a mode, with steps of about half a standard deviation."""
    d = len(u)
    step = np.full(d, 1e-3)
    for _ in range(4):
        f = evaluate(target, u + np.concatenate([np.diag(step), -np.diag(step)]))
        drop = np.maximum(2.0 * top - f[:d] - f[d:], 1e-6)
        step = np.clip(step * np.sqrt(0.25 / drop), step / 30.0, np.minimum(step * 30.0, 0.5))
    i, j = np.triu_indices(d, 1)
    e = np.diag(step)
    corners = [u + si * e[i] + sj * e[j] for si, sj in ((1, 1), (-1, -1), (1, -1), (-1, 1))]
    f = evaluate(target, np.concatenate([u + e, u - e, *corners]))
    f = np.where(np.isfinite(f), f, np.nan)  # infinite minus infinite says nothing either
    single = f[: 2 * d].reshape(2, d)
    hessian = np.diag((single.sum(axis=0) - 2.0 * top) / step**2)
    cross = f[2 * d :].reshape(4, -1)
    hessian[i, j] = hessian[j, i] = (cross[0] + cross[1] - cross[2] - cross[3]) / (4.0 * step[i] * step[j])
    values, vectors = np.linalg.eigh(-np.where(np.isfinite(hessian), hessian, 0.0))
    covariance: Array = (vectors / np.maximum(values, LOOSEST)) @ vectors.T
    return covariance


def _climb_held(start: Array) -> tuple[Array, float]:
    return climb(held_target(), start)


def _structured(target: Collapsed, u: Array) -> Array:
    """A start that takes the misfit for structure (little noise, a large remainder), not for noise."""
    other = u.copy()
    for name, shift in ((WHITE, -1.5), (NOISE, -1.5), (SMOOTH, 1.5), (MISFIT, 2.0)):
        if name in target.model.names:
            other[target.model.names.index(name)] = shift
    return other


def climb_modes(target: Collapsed, starts: list[Array]) -> list[Mode]:
    """Distinct modes that climbs from the starts lead to, best first."""
    with workers(target, len(starts)) as pool:
        ends = pool.map(_climb_held, starts)
    found: list[Mode] = []
    for u, top in sorted(ends, key=lambda end: -end[1]):
        if found and found[0].log_posterior - top > HOPELESS:
            continue
        covariance = curvature(target, u, top)
        precision = np.linalg.inv(covariance)
        if all((u - m.u) @ precision @ (u - m.u) > 4.0 * len(u) for m in found):
            found.append(Mode(u, top, covariance))
    return found


def find_modes(target: Collapsed, rng: np.random.Generator) -> list[Mode]:
    """Modes from the priors' centre, a structured start and the best of many prior draws."""
    d = len(target.model.names)
    draws = rng.standard_normal((TRIED, d))
    for name in {WHITE, NOISE} & set(target.model.names):
        # Under one large noise the draws that fit best come first, not those that happen to have much of it.
        draws[:, target.model.names.index(name)] = LOUD
    best = draws[np.argsort(-evaluate(target, draws))[:CLIMBED]]
    return climb_modes(target, [*starts(target), *best])


def starts(target: Collapsed) -> list[Array]:
    """The priors' centre (d,), and a place that takes the misfit for structure."""
    centre = np.zeros(len(target.model.names))
    return [centre, _structured(target, centre)]
