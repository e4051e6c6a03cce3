"""Hybrid search as in the thesis (3.3): an evolutionary global search, then SQP and interior point.

The evolutionary algorithm is SciPy's differential evolution (it takes bounds, nonlinear constraints and
integers), SQP is its SLSQP, interior point its trust-constr with a logarithmic barrier.
"""

from __future__ import annotations

import itertools
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import optimize
from scipy.optimize import Bounds, NonlinearConstraint

from mpam_calib.design.gradient import gradient, in_box
from mpam_calib.design.problem import Constraint, Problem

Array = NDArray[np.float64]
Local = Literal["SQP", "IP"]
_Function = Callable[[Array], Array]

# Through Any: the stubs know neither vectorised objectives nor constraints as dictionaries.
_differential_evolution: Any = optimize.differential_evolution
_minimize: Any = optimize.minimize

POPULATION, GENERATIONS = 12, 60
"""Individuals for each variable, and generations at most."""
ITERATIONS = (200, 500)
"""Iterations of SQP and of interior point at most."""
AT_BOUND = 1e-9
"""A scaled variable this close to 0 or 1 lies on its bound."""
RESTORATIONS = 3
"""Newton steps back onto a constraint that SQP overstepped by rounding."""
BARRIER = 1e-10
"""Interior point ends when its logarithmic barrier weighs less than this (objective scaled to 1)."""


@dataclass(frozen=True)
class Stage:
    """What one method found: design (SI), objective (N), its iterations and objective evaluations.

    ``history`` holds the objective (N) after every iteration.
    """

    method: str
    x: Array
    value: float
    iterations: int
    evaluations: int
    history: tuple[float, ...]


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


class _Counted:
    """The objective in the unit box, counting the designs it is asked for."""

    def __init__(self, problem: Problem) -> None:
        self.count = 0
        self._function = in_box(problem, problem.objective)

    def __call__(self, u: Array) -> Array:
        self.count += int(np.prod(u.shape[:-1]))
        return self._function(u)


def evolve(problem: Problem, seed: int, generations: int) -> Stage:
    """Global search by differential evolution from a random population."""
    objective = _Counted(problem)
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
    relaxed = _local(problem, start, method, {}, iterations)
    if not problem.integers:
        return relaxed
    choices = [
        {float(np.floor(relaxed.x[i] + 1e-6)), float(np.ceil(relaxed.x[i] - 1e-6))} for i in problem.integers
    ]
    evaluations, best = relaxed.evaluations, None
    for values in itertools.product(*choices):
        fixed = dict(zip(problem.integers, values, strict=True))
        stage = _local(problem, relaxed.x, method, fixed, iterations)
        evaluations += stage.evaluations
        if best is None or stage.value > best.value:
            best = stage
    assert best is not None
    return replace(best, iterations=relaxed.iterations, evaluations=evaluations, history=relaxed.history)


def _local(problem: Problem, start: Array, method: Local, fixed: dict[int, float], iterations: int) -> Stage:
    """One run of SQP or interior point in the unit box over the variables that are not fixed."""
    objective = _Counted(problem)
    base = problem.scaled(start)
    for i, value in fixed.items():
        base[i] = (value - problem.lower[i]) / (problem.upper[i] - problem.lower[i])
    free = np.array([i for i in range(base.size) if i not in fixed])
    size = max(abs(float(problem.objective(start))), 1e-6)
    history: list[float] = []

    def full(v: Array) -> Array:
        u = np.broadcast_to(base, (*v.shape[:-1], base.size)).copy()
        u[..., free] = v
        return u

    def f(v: Array) -> Array:
        return -objective(full(v)) / size

    def sqp_step(v: Array) -> None:
        history.append(float(problem.objective(problem.unscaled(full(v)))))

    def ip_step(v: Array, state: Any) -> bool:
        sqp_step(v)
        # Its own gradient test can stop it while the barrier still holds the design off its bounds.
        return bool(state.barrier_parameter < BARRIER and state.optimality < 1e-8)

    def held(constraint: Constraint) -> tuple[_Function, _Function]:
        def value(v: Array) -> Array:
            return constraint.value(problem.unscaled(full(v)))

        return value, lambda v: gradient(value, v)

    constraints = [held(c) for c in problem.constraints]
    v0 = np.clip(base[free], 0.0, 1.0)
    if method == "SQP":
        result = _minimize(
            lambda v: float(f(v)),
            v0,
            jac=lambda v: gradient(f, v),
            method="SLSQP",
            bounds=Bounds(0.0, 1.0),
            constraints=[{"type": "ineq", "fun": g, "jac": slope} for g, slope in constraints],
            options={"ftol": 1e-13, "maxiter": iterations},
            callback=sqp_step,
        )
        # SLSQP may stop a little outside a constraint: Newton's step along its slope leads back.
        for _ in range(RESTORATIONS):
            for g, slope in constraints:
                short = min(float(g(result.x)), 0.0)
                direction = np.ravel(slope(result.x))
                inside = (result.x > AT_BOUND) & (result.x < 1.0 - AT_BOUND)
                # What lies on its bound is best left there, as long as something else can move.
                direction = np.where(inside, direction, 0.0) if np.any(direction[inside]) else direction
                result.x = np.clip(result.x - short * direction / (direction @ direction), 0.0, 1.0)
    else:
        result = _minimize(
            lambda v: float(f(v)),
            # Interior point starts inside, and with a step and a barrier that keep it near its start.
            np.clip(v0, 0.01, 0.99),
            jac=lambda v: gradient(f, v),
            hess="2-point",
            method="trust-constr",
            bounds=Bounds(0.0, 1.0),
            constraints=[
                NonlinearConstraint(g, 0.0, np.inf, jac=slope, hess="2-point") for g, slope in constraints
            ],
            options={
                "gtol": 1e-300,
                "xtol": 1e-300,
                "barrier_tol": BARRIER / 10.0,
                "maxiter": ITERATIONS[1],
                "initial_tr_radius": 0.05,
                "initial_barrier_parameter": 1e-3,
                "initial_barrier_tolerance": 1e-3,
            },
            callback=ip_step,
        )
    x = problem.unscaled(full(np.clip(np.asarray(result.x), 0.0, 1.0)))
    for i, value in fixed.items():
        x[i] = value
    return Stage(method, x, float(problem.objective(x)), int(result.nit), objective.count, tuple(history))


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
