"""Hybrid search as in the thesis (3.3): an evolutionary global search, then SQP and interior point.

The evolutionary algorithm is SciPy's differential evolution: it takes bounds, nonlinear constraints and
integers.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from scipy.optimize import NonlinearConstraint

from mpam_calib.design.local import ITERATIONS, Counted, Local, Stage, local_search
from mpam_calib.design.problem import Problem

Array = NDArray[np.float64]

# Through Any: the stubs know no vectorised objectives.
_differential_evolution: Any = optimize.differential_evolution

POPULATION, GENERATIONS = 12, 60
"""Individuals for each variable, and generations at most."""


@dataclass(frozen=True)
class Optimum:
    """A hybrid search: the global stage, the local stages that started from it, the best of them."""

    problem: Problem
    start: Stage
    stages: tuple[Stage, ...]

    @property
    def best(self) -> Stage:
        """The stage with the largest objective."""
        return max((self.start, *self.stages), key=lambda s: s.value)

    @property
    def evaluations(self) -> int:
        """Objective evaluations in all, those for gradients included."""
        return self.start.evaluations + sum(s.evaluations for s in self.stages)


def evolve(problem: Problem, seed: int, generations: int) -> Stage:
    """Global search by differential evolution from a random population."""
    objective = Counted(problem)
    history: list[float] = []
    box = np.array([[0.0, 1.0]] * len(problem.variables))
    integral = np.zeros(len(problem.variables), dtype=bool)
    for i in problem.integers:
        box[i] = problem.lower[i], problem.upper[i]
        integral[i] = True

    def scaled(v: Array) -> Array:
        u = np.array(v.T)
        for i in problem.integers:
            u[..., i] = (u[..., i] - problem.lower[i]) / (problem.upper[i] - problem.lower[i])
        return u

    def record(intermediate_result: Any) -> None:
        history.append(-float(intermediate_result.fun))

    def constraint(v: Array) -> Array:
        x = problem.unscaled(scaled(v))
        return np.stack([c.value(x) for c in problem.constraints])

    with warnings.catch_warnings():
        # The population is drawn before the constraints are known; scipy warns while it is infeasible.
        warnings.filterwarnings("ignore", category=UserWarning)
        result = _differential_evolution(
            lambda v: -objective(scaled(v)),
            box,
            popsize=POPULATION,
            maxiter=generations,
            tol=1e-7,
            seed=np.random.default_rng(seed),
            polish=False,
            vectorized=True,
            updating="deferred",
            integrality=integral,
            callback=record,
            constraints=NonlinearConstraint(constraint, 0.0, np.inf),
        )
    x = problem.unscaled(scaled(np.asarray(result.x)[:, None])[0])
    return Stage("GA", x, float(problem.objective(x)), int(result.nit), objective.count, tuple(history))


def refine(problem: Problem, start: Array, method: Local, iterations: int = ITERATIONS[0]) -> Stage:
    """Local search from ``start`` (SI), integers relaxed, then fixed to their neighbours in turn.

    ``iterations`` bounds each run of SQP.
    """
    relaxed = local_search(problem, start, method, {}, iterations)
    if not problem.integers:
        return relaxed
    choices = [
        {float(np.floor(relaxed.x[i] + 1e-6)), float(np.ceil(relaxed.x[i] - 1e-6))} for i in problem.integers
    ]
    evaluations, best = relaxed.evaluations, None
    for values in itertools.product(*choices):
        fixed = dict(zip(problem.integers, values, strict=True))
        stage = local_search(problem, relaxed.x, method, fixed, iterations)
        evaluations += stage.evaluations
        if best is None or stage.value > best.value:
            best = stage
    assert best is not None
    return replace(best, iterations=relaxed.iterations, evaluations=evaluations, history=relaxed.history)


def hybrid(
    problem: Problem,
    seed: int = 0,
    local: tuple[Local, ...] = ("SQP", "IP"),
    generations: int = GENERATIONS,
) -> Optimum:
    """Evolutionary search, then each local method from its result (thesis 3.3)."""
    start = evolve(problem, seed, generations)
    return Optimum(problem, start, tuple(refine(problem, start.x, method) for method in local))


def to_bounds(problem: Problem, x: Array, shares: Sequence[float] = (1.0,)) -> Array:
    """The design (SI) moved towards a bound in one variable at a time, as long as that gains and is allowed.

    By ``shares`` of the way to it, integers to whole ones. What a gradient search leaves undone where one
    variable hardly counts, or the objective has kinks.
    """
    best, value = np.array(x), float(problem.objective(x))
    bounds, whole = (problem.lower, problem.upper), list(problem.integers)
    while True:
        moves = np.concatenate([best + share * np.diag(b - best) for share in shares for b in bounds])
        moves[:, whole] = np.rint(moves[:, whole])
        allowed = [problem.feasible(move) for move in moves]
        values = np.where(allowed, problem.objective(moves), -np.inf)
        i = int(np.argmax(values))
        if values[i] <= value:
            return best
        best, value = moves[i], float(values[i])
