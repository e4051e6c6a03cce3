"""Which bounds and constraints hold the optimum back, and what each would give if it were relaxed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from mpam_calib.design.gradient import gradient, in_box
from mpam_calib.design.problem import Problem

Array = NDArray[np.float64]

ACTIVE = 1e-5
"""A bound (in the unit box) or constraint closer than this counts as active."""


@dataclass(frozen=True)
class ActiveConstraint:
    """A bound or constraint that holds, its Lagrange multiplier and in which unit: N per ``unit``."""

    name: str
    multiplier: float
    unit: str


@dataclass(frozen=True)
class Optimality:
    """First-order (KKT) conditions at a design.

    ``residual`` is the part of the objective's gradient that no active constraint balances, relative
    to the gradient (0: a KKT point); slacks of the inactive constraints are in ``slack``.
    """

    active: tuple[ActiveConstraint, ...]
    slack: dict[str, float]
    residual: float


def optimality(problem: Problem, x: Array) -> Optimality:
    """Active set, multipliers (non-negative least squares) and KKT residual at design ``x`` (SI).

    An integer variable has no gradient condition of its own: it is held by a multiplier only where it
    stands at a bound.
    """
    u = problem.scaled(x)
    ascent = gradient(in_box(problem, problem.objective), u)
    normals: list[Array] = []
    labels: list[tuple[str, str, float]] = []
    slack: dict[str, float] = {}
    for i, variable in enumerate(problem.variables):
        unit = np.zeros(u.size)
        unit[i] = 1.0
        # N per unit of print = N per unit box * (unit of print / box)
        factor = variable.scale / (variable.upper - variable.lower)
        for name, distance, outward in (("lower", u[i], -unit), ("upper", 1.0 - u[i], unit)):
            if distance < ACTIVE:
                normals.append(outward)
                labels.append((f"{variable.symbol} at its {name} bound", variable.unit or "1", factor))
    for constraint in problem.constraints:
        value = float(constraint.value(x))
        if value < ACTIVE:
            normals.append(-gradient(in_box(problem, constraint.value), u))
            labels.append((constraint.name, "1", 1.0))
        else:
            slack[constraint.name] = value
    if not normals:
        return Optimality((), slack, 1.0)
    multipliers, residual = nnls(np.stack(normals, axis=1), ascent)
    active = tuple(
        ActiveConstraint(name, float(m * factor), unit)
        for m, (name, unit, factor) in zip(multipliers, labels, strict=True)
    )
    return Optimality(active, slack, float(residual / np.linalg.norm(ascent)))
