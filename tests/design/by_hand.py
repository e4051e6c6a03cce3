"""An independent reckoning of a muscle without its chain: named effects only, by thesis Eq. 3.12, 4.6, 2.47.

A twin of ``mpam_calib.design.draws`` for tests: blocked force and free contraction of a design by draw.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from mpam_calib.design.blocked import blocked_force, braid_loss
from mpam_calib.design.problem import Function
from mpam_calib.physics.kinematics import SHAPES, Rest, Shape, tip_shortened_length
from mpam_calib.physics.statics import axial_lever, gas_force, hoop_lever, modulus_columns, thickness_force

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MuscleDraws:
    """Draws of what a design does not choose, at one pressure; every array has shape (draws,).

    Pressure ``P`` and ``dead_band`` in Pa, ``delta_alpha`` in rad (the posterior's angle error plus, if
    wanted, draws of the manufacturing tolerance), ``wall_factor``, ``tip_factor`` and ``braid_factor`` as
    in the effects of those names (0: not in the model), ``moduli`` E_k(P) of shape (draws, M) in Pa.
    """

    P: float
    L0: float
    kinematics: Literal["inextensible_braid", "constant_thickness"]
    strain: Literal["engineering", "stretch"]
    moduli: Array
    dead_band: Array
    delta_alpha: Array
    wall_factor: Array
    tip_factor: Array
    braid_factor: Array
    E_br: float

    @classmethod
    def none(cls, P: float, moduli: Array, **declared: Any) -> MuscleDraws:
        """Draws with nothing but moduli: every effect is zero unless given by name."""
        zero = np.zeros(moduli.shape[0])
        values: dict[str, Any] = {
            "L0": 0.05,
            "kinematics": "constant_thickness",
            "strain": "stretch",
            "dead_band": zero,
            "delta_alpha": zero,
            "wall_factor": zero,
            "tip_factor": zero,
            "braid_factor": zero,
            "E_br": 2.1e9,
        }
        return cls(P=P, moduli=moduli, **(values | declared))

    @property
    def pressure(self) -> Array:
        """Pressure that does work, Pa, shape (draws,)."""
        return np.maximum(self.P - self.dead_band, 0.0)


def blocked_forces(draws: MuscleDraws, x: Array) -> Array:
    """Blocked force (N) of designs x (..., 3 or 5), shape (..., draws).

    Designs are R, t, α (Case II) or R, t, α, R_br, n (Case I, whose braid term then counts in full
    unless the draws carry a ``braid_factor``).
    """
    x = np.asarray(x)[..., None, :]
    R, t = x[..., 0], x[..., 1]
    alpha = x[..., 2] + draws.delta_alpha
    P = draws.pressure
    shape = Shape(R, R, t, np.tan(alpha) ** 2)
    force = blocked_force(P, R, t, alpha) - draws.wall_factor * thickness_force(P, shape)
    if draws.strain == "stretch":
        # At rest length both stretches are 1, so that the sum of the moduli is all that matters.
        force = force + draws.moduli.sum(axis=-1) * (axial_lever(shape) - hoop_lever(shape))
    if x.shape[-1] == 5:
        share = np.where(draws.braid_factor == 0.0, 1.0, draws.braid_factor)
        force = force - share * braid_loss(P, R, alpha, x[..., 3], x[..., 4], draws.E_br)
    return np.asarray(force)


def forces_along(draws: MuscleDraws, x: Array, gamma: Array) -> Array:
    """Friction-free force (N) of one design R, t, α at contractions γ, shape (draws, γ)."""
    R0, t0 = np.asarray(x[0]), np.asarray(x[1])
    rest = Rest(np.asarray(draws.L0), R0, t0, (x[2] + draws.delta_alpha)[:, None])
    P = draws.pressure[:, None]
    shape_of = SHAPES[draws.kinematics]
    L = draws.L0 * (1.0 - gamma) + np.zeros_like(P)
    shape = shape_of(L, rest)
    if np.any(draws.tip_factor):
        shape = shape_of(tip_shortened_length(L, shape.R, rest, draws.tip_factor[:, None]), rest)
    columns = modulus_columns(shape, rest, draws.strain, draws.moduli.shape[-1])
    bladder = np.einsum("dgk,dk->dg", columns, draws.moduli)
    thickness = (1.0 - draws.wall_factor[:, None]) * thickness_force(P, shape)
    return np.asarray(gas_force(P, shape) + thickness + bladder)


def free_contractions(draws: MuscleDraws, x: Array, limit: float = 0.5, points: int = 501) -> Array:
    """First root of the friction-free force of one design, shape (draws,).

    0 where F(0) <= 0, nan where F stays positive up to ``limit``; linear between grid points.
    """
    gamma = np.linspace(0.0, limit, points)
    F = forces_along(draws, x, gamma)
    below = F <= 0.0
    first = np.argmax(below, axis=1)
    found = below.any(axis=1)
    rows = np.flatnonzero(found & (first > 0))
    out = np.where(found, 0.0, np.nan)
    i = first[rows]
    f0, f1 = F[rows, i - 1], F[rows, i]
    out[rows] = gamma[i - 1] + (gamma[i] - gamma[i - 1]) * f0 / (f0 - f1)
    return out


def mean_force(draws: MuscleDraws) -> Function:
    """The posterior mean of the blocked force as an objective (N)."""
    return lambda x: np.asarray(blocked_forces(draws, x).mean(axis=-1))


def quantile_force(draws: MuscleDraws, q: float = 0.05) -> Function:
    """A quantile of the blocked force as an objective (N): what can be relied on."""
    return lambda x: np.asarray(np.quantile(blocked_forces(draws, x), q, axis=-1))
