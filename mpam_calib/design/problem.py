"""What is searched for: variables with bounds, an objective, constraints (thesis Eq. 3.15, 3.18)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.design.blocked import blocked_force, braid_loss, room_for_strands, volume_ratio
from mpam_calib.units import DEG, GPA, MM

Array = NDArray[np.float64]
Function = Callable[[Array], Array]
"""From designs of shape (..., variables), SI, to one number each, shape (...)."""

E_BR = 2.1 * GPA
"""Young's modulus of the braid in chapter 3, Pa."""
RATIO_LOW, RATIO_HIGH = 0.4, 2.0
"""Bounds on V_bl/V (Eq. 3.15). The upper one cannot bind: the ratio never exceeds 1."""


@dataclass(frozen=True)
class Variable:
    """A design variable: bounds in SI units, and how many SI units make one unit of print."""

    symbol: str
    unit: str
    lower: float
    upper: float
    scale: float
    integer: bool = False


@dataclass(frozen=True)
class Constraint:
    """``value(x) >= 0`` where the design is allowed."""

    name: str
    value: Function


@dataclass(frozen=True)
class Problem:
    """Maximise ``objective`` (N) within the bounds and constraints."""

    name: str
    variables: tuple[Variable, ...]
    objective: Function
    constraints: tuple[Constraint, ...]

    @property
    def lower(self) -> Array:
        """Lower bounds, SI."""
        return np.array([v.lower for v in self.variables])

    @property
    def upper(self) -> Array:
        """Upper bounds, SI."""
        return np.array([v.upper for v in self.variables])

    @property
    def integers(self) -> tuple[int, ...]:
        """Positions of the integer variables."""
        return tuple(i for i, v in enumerate(self.variables) if v.integer)

    def scaled(self, x: Array) -> Array:
        """From SI to the unit box that the searches walk in."""
        return (x - self.lower) / (self.upper - self.lower)

    def unscaled(self, u: Array) -> Array:
        """From the unit box to SI."""
        return self.lower + u * (self.upper - self.lower)

    def feasible(self, x: Array, tolerance: float = 1e-9) -> bool:
        """Whether one design keeps bounds and constraints to ``tolerance`` (in scaled units)."""
        u = self.scaled(x)
        inside = bool(np.all(u >= -tolerance) and np.all(u <= 1.0 + tolerance))
        return inside and all(float(c.value(x)) >= -tolerance for c in self.constraints)


# Table 3.1.
R = Variable("R", "mm", 0.45 * MM, 3.0 * MM, MM)
T = Variable("t", "mm", 0.16 * MM, 1.5 * MM, MM)
ALPHA = Variable("α", "°", 36.0 * DEG, 72.0 * DEG, DEG)
R_BR = Variable("R_br", "mm", 0.005 * MM, 2.5 * MM, MM)
N = Variable("n", "", 30.0, 100.0, 1.0, integer=True)

WALL = (R, T, ALPHA)
BRAIDED = (R, T, ALPHA, R_BR, N)


def ratio_constraints(low: float = RATIO_LOW) -> tuple[Constraint, ...]:
    """The two constraints on V_bl/V of Eq. 3.15; designs start with R and t."""
    return (
        Constraint("V_bl/V >= low", lambda x: volume_ratio(x[..., 0], x[..., 1]) - low),
        Constraint("V_bl/V <= high", lambda x: RATIO_HIGH - volume_ratio(x[..., 0], x[..., 1])),
    )


def packing_constraint() -> Constraint:
    """n strands of radius R_br must fit round the muscle (not in the thesis)."""
    return Constraint("packing", lambda x: room_for_strands(x[..., 0], x[..., 2], x[..., 3], x[..., 4]))


def case_two(P: float, ratio_low: float = RATIO_LOW, objective: Function | None = None) -> Problem:
    """Case II (Eq. 3.16, 3.18) at pressure P (Pa): R, t, α; ``objective`` replaces Eq. 3.16."""

    def force(x: Array) -> Array:
        return blocked_force(np.asarray(P), x[..., 0], x[..., 1], x[..., 2])

    return Problem("Case II", WALL, objective or force, ratio_constraints(ratio_low))


def case_one(
    P: float,
    packing: bool = False,
    strand_radius: float | None = None,
    objective: Function | None = None,
) -> Problem:
    """Case I (Eq. 3.12, 3.15) at pressure P (Pa): R, t, α, R_br, n.

    ``packing`` adds that the strands must fit; ``strand_radius`` (m) lowers the upper bound of R_br to
    that of a real monofilament; ``objective`` replaces Eq. 3.12.
    """

    def force(x: Array) -> Array:
        p = np.asarray(P)
        loss = braid_loss(p, x[..., 0], x[..., 2], x[..., 3], x[..., 4], E_BR)
        return blocked_force(p, x[..., 0], x[..., 1], x[..., 2]) - loss

    constraints = ratio_constraints() + ((packing_constraint(),) if packing else ())
    variables = BRAIDED
    if strand_radius is not None:
        variables = (*WALL, Variable("R_br", "mm", R_BR.lower, strand_radius, MM), N)
    return Problem("Case I", variables, objective or force, constraints)
