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

from mpam_calib.criticism.problem import Problem
from mpam_calib.model.bend import BENDS
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.chain import Chain
from mpam_calib.model.model import build_model

Array = NDArray[np.float64]

STEP = 1e-4
ROUNDS = 25
CONVERGED, SHARE = 5e-3, 1e-4
"""Where the next round promises fewer nats than this, or than this share of the misfit, the climb ends."""
RIDGE = 0.02
"""Least damping after a step that led downhill."""
NUDGE = 1e-4
"""Step of a force that depends on itself, as a share of the force scale."""
SETTLED = 0.02
"""Share of a reading's noise to which a force that depends on itself must have settled."""
FURTHEST, MOST_BENT = 7.0, 2.5
"""Largest coordinate (prior sds) of a size, and of a bend."""
REACH = 1.5
"""Longest step of a coordinate, prior sds."""
COARSE = 0.01
"""Share of the misfit below which the sizes have settled well enough to let them bend."""


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
    axes, spread = problem.axes[0], problem.spreads[size][:, None]
    readings, first, second = problem.lean
    still = SETTLED * problem.noise_level.total

    def terms(u: Array, guide: Array) -> tuple[Array, Array]:
        values = {q.name: q.prior.from_normal(u[:, i : i + 1]) for i, q in enumerate(chain.parameters)}
        if not values:
            values = {"": np.zeros((len(u), 1))}
        got = chain.terms(values, readings, guide)
        fixed = np.broadcast_to(got.fixed, (len(u), len(readings)))
        columns = np.broadcast_to(got.columns, (len(u), len(readings), p))
        return fixed, columns

    u: Array = np.array([(start or {}).get(name, 0.0) for name in names], dtype=np.float64)
    eta: Array = np.zeros(p)
    guide = np.empty(len(readings))
    guide[:n], guide[first], guide[second] = problem.force, problem.force, problem.force
    best: tuple[float, Array, Array, Array, Array, Array] | None = None
    damping = 1e-3
    bends = np.array([BENDS in name for name in names], dtype=bool)
    furthest = np.where(bends, MOST_BENT, FURTHEST)
    released = not bends.any() or bool(np.any(u[bends] != 0.0))
    offsets = np.concatenate([np.zeros((1, d)), STEP * np.eye(d)])
    nudge = NUDGE * problem.force_scale
    for _turn in range(ROUNDS):
        if chain.uses_force:
            fixed, columns = terms(u + np.concatenate([offsets, offsets[:1]]), _nudged(guide, d + 2, nudge))
            # A force that depends on itself, F = f(F): one Newton step of its fixed point, for all at once.
            slope = (fixed[-1] - fixed[0] + (columns[-1] - columns[0]) @ eta) / nudge
            factor = 1.0 / np.clip(1.0 - slope, 0.2, 5.0)
            fixed = guide + (fixed[:-1] - guide) * factor
            columns = columns[:-1] * factor[:, None]
        else:
            fixed, columns = terms(u + offsets, guide)
        whole, whole_columns = fixed[0], columns[0]
        fixed = 0.5 * (fixed[:, first] + fixed[:, second]) + problem.bow
        columns = 0.5 * (columns[:, first] + columns[:, second])
        white = (axes @ np.column_stack([problem.force - fixed[0], columns[0]])) / spread
        residual, X = white[:, 0], white[:, 1:]
        # Given the sizes, the moduli's optimum is exact.
        gram = X.T @ X + np.eye(p)
        eta = np.asarray(linalg.solve(gram, X.T @ residual, assume_a="pos")) if p else eta
        residual = residual - X @ eta
        objective = -0.5 * float(residual @ residual + u @ u + eta @ eta)
        if not np.isfinite(objective):
            objective = -np.inf
        if best is None or objective > best[0]:
            force = fixed[0] + columns[0] @ eta
            moved = (fixed[1:] - fixed[0]) + (columns[1:] - columns[0]) @ eta
            J = np.concatenate([(axes @ moved.T) / (STEP * spread), X], axis=1)
            best = (objective, u, eta, J, residual, force)
            damping = max(damping / 5.0, 1e-6)
            # What depends on the force is fed with the model's own.
            own = whole + whole_columns @ eta
            waiting = chain.uses_force and float(np.abs(own - guide).max()) > still
            guide = own
        else:
            waiting = False
            damping = max(8.0 * damping, RIDGE)
            if damping > 1e4:
                break
        _, at, at_eta, J, residual, _ = best
        hessian = J.T @ J + np.eye(d + p)
        gradient = J.T @ residual - np.concatenate([at, at_eta])
        enough = max(CONVERGED, SHARE * float(residual @ residual))
        free = np.ones(d + p, dtype=bool)
        free[:d] = ((np.abs(at) < furthest) | (at * gradient[:d] < 0.0)) & (released | ~bends)
        damped = hessian[np.ix_(free, free)] + damping * np.diag(np.diagonal(hessian)[free])
        step = np.zeros(d + p)
        step[free] = linalg.solve(damped, gradient[free], assume_a="pos")
        promise = 0.5 * float(step @ gradient)
        if d == 0 or (promise < enough and not waiting and released):
            break
        # Sizes first: the bend of a size near zero says nothing and wanders off.
        released = released or promise < COARSE * float(residual @ residual)
        step *= min(1.0, REACH / float(np.abs(step[:d]).max(initial=1e-9)))
        u = np.clip(at + step[:d], -furthest, furthest)
    assert best is not None
    objective, u, eta, J, residual, force = best
    hessian = J.T @ J + np.eye(d + p)
    factor = linalg.cho_factor(hessian, lower=True)
    log_det = 2.0 * float(np.sum(np.log(np.diagonal(factor[0]))))
    evidence = objective - 0.5 * (problem.log_dets[size] + n * np.log(2.0 * np.pi) + log_det)
    covariance = np.asarray(linalg.cho_solve(factor, np.eye(d + p)))
    return Fit(effects, size, names, u, eta, covariance, force, float(evidence), float(residual @ residual))


def _nudged(guide: Array, copies: int, nudge: float) -> Array:
    """The guide (m,) for every row of a batch (copies, m), the last one moved."""
    rows = np.repeat(guide[None, :], copies, axis=0)
    rows[-1] += nudge
    return rows
