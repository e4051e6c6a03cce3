"""One hypothesis, refitted exactly: Levenberg-Marquardt on its sizes and the moduli together.

Sizes are sampler coordinates (standard normal priors), moduli the block's own; both priors enter as
pseudo-observations, and the evidence is Laplace's with the Gauss-Newton Hessian.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from mpam_calib.criticism.problem import SIZES, Problem
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.chain import Chain
from mpam_calib.model.model import build_model

Array = NDArray[np.float64]

STEP = 1e-4
ROUNDS = 25
CONVERGED = 1e-3
"""Nats below which a round's gain ends the climb."""
FURTHEST = 7.0
"""Largest coordinate: seven prior sds."""


@dataclass(frozen=True)
class Fit:
    """A refitted hypothesis: its effects, the remainder's size, coordinates and how good it is.

    ``u`` (d,) and ``eta`` (p,) at the mode with covariance (d + p, d + p); ``force`` (n,) the model's;
    ``log_evidence`` in nats, ``chi2`` the whitened sum of squares.
    """

    effects: frozenset[str]
    size: int
    names: tuple[str, ...]
    u: Array
    eta: Array
    covariance: Array
    force: Array
    log_evidence: float
    chi2: float


def extended(blueprint: Blueprint, effects: frozenset[str]) -> Blueprint:
    """The blueprint with more effects declared."""
    simulation = blueprint.simulation
    listed = (*simulation.effects, *sorted(effects))
    return blueprint.model_copy(update={"simulation": simulation.model_copy(update={"effects": listed})})


@lru_cache(maxsize=4096)
def chain_for(key: str, effects: frozenset[str]) -> Chain:
    """The chain of a blueprint (as JSON) with more effects."""
    chain = build_model(extended(Blueprint.model_validate_json(key), effects)).chain
    assert chain is not None
    return chain


def fit(
    problem: Problem,
    effects: frozenset[str],
    size: int,
    start: dict[str, float] | None = None,
    blueprint: Blueprint | None = None,
) -> Fit:
    """Refit the simulation with these effects against a remainder of SIZES[size].

    ``start`` gives coordinates by parameter name to start from (0 otherwise); ``blueprint`` another
    declared simulation than the problem's.
    """
    chain = chain_for((blueprint or problem.blueprint).model_dump_json(), effects)
    names = tuple(p.name for p in chain.parameters)
    d, p, n = len(names), chain.linear_size, len(problem)
    root = problem.roots[size]

    def whiten(x: Array) -> Array:
        return np.asarray(linalg.solve_triangular(root, x, lower=True, check_finite=False))

    def terms(u: Array, guide: Array) -> tuple[Array, Array]:
        values = {q.name: q.prior.from_normal(u[:, i : i + 1]) for i, q in enumerate(chain.parameters)}
        if not values:
            values = {"": np.zeros((len(u), 1))}
        got = chain.terms(values, problem.readings, guide)
        fixed = np.broadcast_to(got.fixed, (len(u), 2 * n))
        columns = np.broadcast_to(got.columns, (len(u), 2 * n, p))
        return 0.5 * (fixed[:, :n] + fixed[:, n:]), 0.5 * (columns[:, :n] + columns[:, n:])

    u: Array = np.array([(start or {}).get(name, 0.0) for name in names], dtype=np.float64)
    eta: Array = np.zeros(p)
    guide = np.concatenate([problem.force, problem.force])
    best: tuple[float, Array, Array, Array, Array, Array] | None = None
    damping = 1e-3
    offsets = np.concatenate([np.zeros((1, d)), STEP * np.eye(d)])
    for _ in range(ROUNDS):
        fixed, columns = terms(u + offsets, guide)
        X = whiten(columns[0])
        residual = whiten(problem.force - fixed[0])
        # Given the sizes, the moduli's optimum is exact.
        gram = X.T @ X + np.eye(p)
        eta = np.asarray(linalg.solve(gram, X.T @ residual, assume_a="pos")) if p else eta
        residual = residual - X @ eta
        objective = -0.5 * float(residual @ residual + u @ u + eta @ eta)
        if not np.isfinite(objective):
            objective = -np.inf
        if best is None or objective > best[0]:
            gain = np.inf if best is None else objective - best[0]
            force = fixed[0] + columns[0] @ eta
            moved = (fixed[1:] - fixed[0]) + (columns[1:] - columns[0]) @ eta
            J = np.concatenate([whiten(moved.T) / STEP, X], axis=1)
            best = (objective, u, eta, J, residual, force)
            damping = max(damping / 5.0, 1e-6)
            # What depends on the force is fed with the model's own.
            guide = np.concatenate([force, force])
            if gain < CONVERGED or d == 0:
                break
        else:
            damping *= 8.0
            if damping > 1e4:
                break
        _, at, at_eta, J, residual, _ = best
        hessian = J.T @ J + np.eye(d + p)
        gradient = J.T @ residual - np.concatenate([at, at_eta])
        step = linalg.solve(hessian + damping * np.diag(np.diagonal(hessian)), gradient, assume_a="pos")
        u = np.clip(at + step[:d], -FURTHEST, FURTHEST)
    assert best is not None
    objective, u, eta, J, residual, force = best
    hessian = J.T @ J + np.eye(d + p)
    factor = linalg.cho_factor(hessian, lower=True)
    log_det = 2.0 * float(np.sum(np.log(np.diagonal(factor[0]))))
    evidence = objective - 0.5 * (problem.log_dets[size] + n * np.log(2.0 * np.pi) + log_det)
    covariance = np.asarray(linalg.cho_solve(factor, np.eye(d + p)))
    return Fit(effects, size, names, u, eta, covariance, force, float(evidence), float(residual @ residual))


def sizes_in_play() -> range:
    """Indices of the remainder's sizes."""
    return range(len(SIZES))
