"""What a fit predicts of readings, linearised at its mode: their mean and their joint covariance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.climb import NUDGE, STEP
from mpam_calib.criticism.fitting.fit import Fit, chain_for, doubt_about
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.chain import SLOPES, Chain
from mpam_calib.model.effect import Values

Array = NDArray[np.float64]

TELLING = 2.0
"""Rows tell of a misfit while their noise's sd is at most this many times the typical row's."""


def predict_rows(
    problem: Problem,
    fitted: Fit,
    index: tuple[NDArray[np.intp], NDArray[np.intp]],
    blueprint: Blueprint | None = None,
) -> tuple[Array, Array]:
    """Mean (h,) and covariance (h, h) of the readings of some rows, given a fit to others.

    ``index`` holds the fitted and the predicted rows; ``blueprint`` another simulation than the problem's.
    """
    force, J = linearise(problem, fitted, blueprint)
    train, held = index
    more = _outgrown(problem, fitted, train)
    covariance = problem.covariance(more * SIZES[fitted.size])
    cross = covariance[np.ix_(held, train)]
    inner = covariance[np.ix_(train, train)]
    weights = linalg.solve(inner, cross.T, assume_a="pos").T
    mean = force[held] + weights @ (problem.force[train] - force[train])
    moved = J[held] - weights @ J[train]
    own = covariance[np.ix_(held, held)] - weights @ cross.T
    return mean, more**2 * moved @ fitted.covariance @ moved.T + own


def _outgrown(problem: Problem, fitted: Fit, train: NDArray[np.intp]) -> float:
    """How many times its largest size the remainder needs to be to hold what the fit leaves of its rows.

    The search has no use for a larger one, but a prediction that trusts it would be far too sure.
    """
    if fitted.size < len(SIZES) - 1:
        return 1.0
    left = problem.force[train] - fitted.force - fitted.doubt
    more = beyond_noise(left, np.diagonal(problem.noise)[train])
    return max(1.0, float(np.sqrt(more)) / (SIZES[-1] * problem.force_scale))


def _columns(chain: Chain, values: Values, problem: Problem, force: Array, eta: Array) -> Array:
    """What the moduli's coordinates make of a force (m,) that may depend on itself, (m, p)."""
    given = chain.terms(values, problem.readings, force)
    if not chain.uses_force:
        return np.asarray(given.columns[0])
    step = NUDGE * problem.force_scale
    nudged = chain.terms(values, problem.readings, force + step)
    moved = nudged.fixed - given.fixed + (nudged.columns - given.columns) @ eta
    # F = f(F): a change of f is one of F, and that another of f.
    slope = np.clip(moved / step, *SLOPES)
    return np.asarray((given.columns / (1.0 - slope)[..., None])[0])


def linearise(problem: Problem, fitted: Fit, blueprint: Blueprint | None = None) -> tuple[Array, Array]:
    """Force (n,), the doubt's part in it, and Jacobian (n, d + p + r) at a fit, on all rows of a problem."""
    key = problem.declared if blueprint is None else blueprint.model_dump_json()
    chain = chain_for(key, fitted.effects)
    n, d = len(problem), len(fitted.u)
    points = fitted.u + np.concatenate([np.zeros((1, d)), STEP * np.eye(d)])
    values = {q.name: q.prior.from_normal(points[:, i : i + 1]) for i, q in enumerate(chain.parameters)}
    if not values:
        values = {"": np.zeros((1, 1))}
    eta = np.broadcast_to(fitted.eta, (len(points), len(fitted.eta)))
    force = np.broadcast_to(chain.force(values, eta, problem.readings), (len(points), 2 * n))
    mean = 0.5 * (force[:, :n] + force[:, n:])
    one = {name: v[:1] for name, v in values.items()}
    columns = np.broadcast_to(_columns(chain, one, problem, force[0], fitted.eta), (2 * n, chain.linear_size))
    X = 0.5 * (columns[:n] + columns[n:])
    J = np.concatenate([(mean[1:] - mean[0]).T / STEP, X], axis=1)
    D = doubt_about(problem, key, fitted)
    return mean[0] + D @ fitted.zeta, np.concatenate([J, D], axis=1)


def beyond_noise(residual: Array, variance: Array) -> float:
    """Mean square (N²) of residuals (n,) beyond the noise's variances (n,).

    Rows that nothing can be read from, their noise far above the typical (the crosshead rested there), are
    left out: their doubt would pass for noise of all the others.
    """
    telling = variance <= TELLING**2 * np.median(variance)
    return max(float(np.mean(residual[telling] ** 2 - variance[telling])), 0.0)
