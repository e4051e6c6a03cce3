"""The fixed reference grid on which the linear block's prior is stated in newtons.

Declared levels × contraction, at the declared geometry: never the fitted rows, so that folds, added
files and simulations share one prior and their evidences can be compared.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.physics.kinematics import SHAPES, Rest, Shape
from mpam_calib.physics.statics import gas_force
from mpam_calib.specimen.declaration import Geometry

Array = NDArray[np.float64]

GRID_POINTS = 16


def rest_of(geometry: Geometry) -> Rest:
    """The declared geometry at rest as (1, 1) arrays (SI)."""
    L0, R0, t0, alpha0 = np.array([geometry.L0, geometry.R0, geometry.t0, geometry.alpha0])[:, None, None]
    return Rest(L0, R0, t0, alpha0)


def geometric_contraction(geometry: Geometry) -> float:
    """Contraction at which an ideal braid stops pulling: 2T = 1, sin α = 1/√3 (thesis Eq. 3.16's first term).

    At least 0.1, so that a sleeve that is declared near its neutral angle still has a grid.
    """
    return float(max(1.0 - 1.0 / (np.sqrt(3.0) * np.sin(geometry.alpha0)), 0.1))


def reference_contractions(geometry: Geometry) -> Array:
    """The grid's contractions, shape (GRID_POINTS,): from 0 to the geometric limit."""
    return np.linspace(0.0, geometric_contraction(geometry), GRID_POINTS)


def reference_shape(geometry: Geometry, kinematics: str) -> Shape:
    """The declared muscle's shape on the grid's contractions."""
    L = geometry.L0 * (1.0 - reference_contractions(geometry))
    shape = SHAPES[kinematics](L, rest_of(geometry))
    return Shape(*(part.reshape(-1) for part in shape))


def force_scale(geometry: Geometry, levels: Array) -> float:
    """Root mean square of the ideal gas force over the grid, N: the size of a force for this specimen."""
    shape = reference_shape(geometry, "inextensible_braid")
    forces = gas_force(levels[:, None], shape)
    return float(np.sqrt(np.mean(forces**2)))
