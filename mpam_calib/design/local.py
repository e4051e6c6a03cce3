"""Local search in the unit box: SQP, and interior point with a logarithmic barrier (SciPy's, thesis 3.3)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
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

# Through Any: the stubs do not know constraints as dictionaries.
_minimize: Any = optimize.minimize

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


class Counted:
    """The objective in the unit box, counting the designs it is asked for."""

    def __init__(self, problem: Problem) -> None:
        self.count = 0
        self._function = in_box(problem, problem.objective)

    def __call__(self, u: Array) -> Array:
        """At scaled designs (..., variables), N."""
        self.count += int(np.prod(u.shape[:-1]))
        return self._function(u)


class _Face:
    """The unit box with some variables fixed: what SciPy is asked about, and what it has found so far."""

    def __init__(self, problem: Problem, start: Array, fixed: dict[int, float]) -> None:
        self.problem, self.fixed = problem, fixed
        self.objective = Counted(problem)
        self.base = problem.scaled(start)
        for i, value in fixed.items():
            self.base[i] = (value - problem.lower[i]) / (problem.upper[i] - problem.lower[i])
        self.free: NDArray[np.int64] = np.array([i for i in range(self.base.size) if i not in fixed])
        self.size = max(abs(float(problem.objective(start))), 1e-6)
        self.constraints = [self._held(c) for c in problem.constraints]
        self.history: list[float] = []

    @property
    def start(self) -> Array:
        """The free variables (free,) of the start."""
        return np.clip(self.base[self.free], 0.0, 1.0)

    def full(self, v: Array) -> Array:
        """All scaled variables (..., variables) for the free ones (..., free)."""
        u = np.broadcast_to(self.base, (*v.shape[:-1], self.base.size)).copy()
        u[..., self.free] = v
        return u

    def loss(self, v: Array) -> Array:
        """The objective's negative, about 1 in size."""
        return -self.objective(self.full(v)) / self.size

    def record(self, v: Array) -> None:
        """Note the objective after an iteration."""
        self.history.append(float(self.problem.objective(self.problem.unscaled(self.full(v)))))

    def stage(self, method: Local, result: Any) -> Stage:
        """What a method ended with."""
        x = self.problem.unscaled(self.full(np.clip(np.asarray(result.x), 0.0, 1.0)))
        for i, value in self.fixed.items():
            x[i] = value
        found, iterations = float(self.problem.objective(x)), int(result.nit)
        return Stage(method, x, found, iterations, self.objective.count, tuple(self.history))

    def _held(self, constraint: Constraint) -> tuple[_Function, _Function]:
        def value(v: Array) -> Array:
            return constraint.value(self.problem.unscaled(self.full(v)))

        return value, lambda v: gradient(value, v)


def local_search(
    problem: Problem, start: Array, method: Local, fixed: dict[int, float], iterations: int
) -> Stage:
    """One run of a method from ``start`` (SI) over the variables that are not ``fixed`` (SI, by place).

    ``iterations`` bounds SQP.
    """
    face = _Face(problem, start, fixed)
    return face.stage(method, _sqp(face, iterations) if method == "SQP" else _interior_point(face))


def _sqp(face: _Face, iterations: int) -> Any:
    result = _minimize(
        lambda v: float(face.loss(v)),
        face.start,
        jac=lambda v: gradient(face.loss, v),
        method="SLSQP",
        bounds=Bounds(0.0, 1.0),
        constraints=[{"type": "ineq", "fun": g, "jac": slope} for g, slope in face.constraints],
        options={"ftol": 1e-13, "maxiter": iterations},
        callback=face.record,
    )
    for _ in range(RESTORATIONS):
        for g, slope in face.constraints:
            result.x = _restored(result.x, g, slope)
    return result


def _restored(v: Array, g: _Function, slope: _Function) -> Array:
    """Back inside a constraint of which SLSQP stopped a little outside: by Newton's step along its slope."""
    short = min(float(g(v)), 0.0)
    direction = np.ravel(slope(v))
    inside = (v > AT_BOUND) & (v < 1.0 - AT_BOUND)
    # What lies on its bound is best left there, as long as something else can move.
    direction = np.where(inside, direction, 0.0) if np.any(direction[inside]) else direction
    return np.clip(v - short * direction / (direction @ direction), 0.0, 1.0)


def _interior_point(face: _Face) -> Any:
    def step(v: Array, state: Any) -> bool:
        face.record(v)
        # Its own gradient test can stop it while the barrier still holds the design off its bounds.
        return bool(state.barrier_parameter < BARRIER and state.optimality < 1e-8)

    return _minimize(
        lambda v: float(face.loss(v)),
        # Interior point starts inside, and with a step and a barrier that keep it near its start.
        np.clip(face.start, 0.01, 0.99),
        jac=lambda v: gradient(face.loss, v),
        hess="2-point",
        method="trust-constr",
        bounds=Bounds(0.0, 1.0),
        constraints=[
            NonlinearConstraint(g, 0.0, np.inf, jac=slope, hess="2-point") for g, slope in face.constraints
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
        callback=step,
    )
