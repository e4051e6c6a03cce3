"""From the muscle's length to its radius, wall and braid angle.

Every function broadcasts over its arguments. Angles are measured from the hoop direction; T = tan²α.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SHORTEST = 0.05
"""Shortest muscle whose shape is reckoned, as a share of its length at rest."""
SIN_LIMIT = 1.0 - 1e-9
"""Strands cannot be stretched straight: beyond this sin α the geometry is held there."""


class Rest(NamedTuple):
    """Geometry at rest: length L0, outer radius R0, wall t0 (m), braid angle alpha0 (rad)."""

    L0: Array
    R0: Array
    t0: Array
    alpha0: Array

    @property
    def strand(self) -> Array:
        """Length of a strand, m: B = L0 / sin α0 (thesis Eq. 2.1)."""
        return self.L0 / np.sin(self.alpha0)

    @property
    def winding(self) -> Array:
        """Angle by which a strand winds round the muscle, rad: 2πN = B cos α0 / R0 (thesis Eq. 2.2)."""
        return self.strand * np.cos(self.alpha0) / self.R0


class Shape(NamedTuple):
    """Geometry under load: outer radius R and wall t (m), T = tan²α, length L (m)."""

    L: Array
    R: Array
    t: Array
    T: Array


def sin_braid_angle(L: Array, rest: Rest) -> Array:
    """Sine of the braid angle at length L (m): sin α = L / B, B = L0 / sin α0 (thesis Eq. 2.1, 4.15)."""
    return np.minimum(L / rest.L0 * np.sin(rest.alpha0), SIN_LIMIT)


def tan2_braid_angle(L: Array, rest: Rest) -> Array:
    """T = tan²α at length L (m), from Eq. 4.15."""
    return _tan2(sin_braid_angle(L, rest) ** 2)


def _tan2(sin2: Array) -> Array:
    return sin2 / (1.0 - sin2)


def radius_inextensible_braid(L: Array, rest: Rest) -> Array:
    """Outer radius (m) with strands of constant length: R = R0 cos α / cos α0 (thesis Eq. 2.10, 2.37)."""
    return _radius_of_the_braid(sin_braid_angle(L, rest) ** 2, rest)


def _radius_of_the_braid(sin2: Array, rest: Rest) -> Array:
    return rest.R0 * np.sqrt(1.0 - sin2) / np.cos(rest.alpha0)


def wall_at_constant_volume(L: Array, R: Array, rest: Rest) -> Array:
    """Wall thickness (m) of a bladder of constant volume (thesis Eq. 2.6).

    L (2Rt − t²) = L0 (2 R0 t0 − t0²); the root below R. Where the wall's volume would fill the whole
    cylinder the thickness is R.
    """
    return R - np.sqrt(np.maximum(R**2 - _section(L, rest), 0.0))


def _section(L: Array, rest: Rest) -> Array:
    """Section of a wall of constant volume over π, m²: 2Rt − t² at length L (m)."""
    return rest.L0 * (2.0 * rest.R0 * rest.t0 - rest.t0**2) / L


def wall_of_a_thin_bladder(L: Array, R: Array, rest: Rest) -> Array:
    """Wall thickness (m) whose volume is reckoned as that of a thin wall: t = t0 R0 L0 / (R L)."""
    return rest.t0 * rest.R0 * rest.L0 / (R * L)


def wall_of_a_thin_section(L: Array, R: Array, rest: Rest) -> Array:
    """Wall thickness (m) that keeps the section of a thin wall, as if no length changed: t = t0 R0 / R."""
    return rest.t0 * rest.R0 / R


def wall_as_at_rest(L: Array, R: Array, rest: Rest) -> Array:
    """Wall thickness (m) that stays what it was at rest."""
    return rest.t0 + np.zeros_like(R)


def radius_constant_thickness(L: Array, rest: Rest) -> Array:
    """Outer radius (m) of a bladder of constant volume and constant thickness (thesis Eq. 4.16)."""
    return (_section(L, rest) + rest.t0**2) / (2.0 * rest.t0)


def shape_inextensible_braid(L: Array, rest: Rest) -> Shape:
    """R from Eq. 2.10, t from the constant wall volume (Eq. 2.6), T from Eq. 4.15."""
    return _shape_of_the_braid(L, rest, "inextensible_braid")


def _shape_of_the_braid(L: Array, rest: Rest, kinematics: str) -> Shape:
    sin2 = sin_braid_angle(L, rest) ** 2
    R = _radius_of_the_braid(sin2, rest)
    return Shape(L, R, WALLS[kinematics](L, R, rest), _tan2(sin2))


def shape_constant_thickness(L: Array, rest: Rest) -> Shape:
    """R from Eq. 4.16, t = t0, T from Eq. 4.15: the thesis's own simulation."""
    R = radius_constant_thickness(L, rest)
    return Shape(L, R, wall_as_at_rest(L, R, rest), tan2_braid_angle(L, rest))


def swollen(shape: Shape, rest: Rest, factor: Array) -> Shape:
    """A shape whose radius grows ``factor`` times as much, R0 + factor·(R − R0), its wall's volume kept.

    Strands that lie a distance δ outside the bladder's surface give factor 1 + δ/R0 (Eq. 2.10 for R + δ).
    """
    if np.all(factor == 1.0):
        return shape
    R = np.maximum(rest.R0 + factor * (shape.R - rest.R0), 1e-3 * rest.R0)
    return Shape(shape.L, R, wall_at_constant_volume(shape.L, R, rest), shape.T)


def with_longer_strands(shape: Shape, rest: Rest, kinematics: str, strain: Array) -> Shape:
    """A shape whose strands are longer by a share ``strain``: sin α = L/(B (1 + ε)) (Eq. 2.1, 4.15).

    Where the braid sets the radius, 2πN R = √(B² (1 + ε)² − L²) (Eq. 2.10) in place of √(B² − L²).
    """
    sin2 = sin_braid_angle(shape.L, rest) ** 2
    longer = (1.0 + strain) ** 2
    T = np.minimum(sin2, SIN_LIMIT**2 * longer)
    T = T / (longer - T)
    if kinematics == "constant_thickness":
        return Shape(shape.L, shape.R, shape.t, T)
    R = shape.R * np.sqrt(np.maximum(longer - sin2, 0.0) / (1.0 - sin2))
    return Shape(shape.L, R, WALLS[kinematics](shape.L, R, rest), T)


def tip_shortened_length(L: Array, R: Array, rest: Rest, factor: Array) -> Array:
    """Working length (m) with rounded tips: L′ = L − 2·factor·(π/2 − 1)(R − R0) (thesis Eq. 2.46-2.47)."""
    return L - 2.0 * factor * (np.pi / 2.0 - 1.0) * (R - rest.R0)


def shape_braid_of_constant_thickness(L: Array, rest: Rest) -> Shape:
    """R from Eq. 2.10, t = t0, T from Eq. 4.15: a wall that keeps its thickness within the strands."""
    return _shape_of_the_braid(L, rest, "braid_of_constant_thickness")


def shape_braid_of_thin_wall(L: Array, rest: Rest) -> Shape:
    """R from Eq. 2.10, t = t0 R0 L0 / (R L), T from Eq. 4.15: the volume as of a thin wall."""
    return _shape_of_the_braid(L, rest, "braid_of_thin_wall")


def shape_braid_of_thin_section(L: Array, rest: Rest) -> Shape:
    """R from Eq. 2.10, t = t0 R0 / R, T from Eq. 4.15: a thin wall that is stretched round alone."""
    return _shape_of_the_braid(L, rest, "braid_of_thin_section")


WALLS = {
    "inextensible_braid": wall_at_constant_volume,
    "braid_of_constant_thickness": wall_as_at_rest,
    "braid_of_thin_wall": wall_of_a_thin_bladder,
    "braid_of_thin_section": wall_of_a_thin_section,
}
"""The wall's thickness where the braid sets the radius."""

SHAPES = {
    "inextensible_braid": shape_inextensible_braid,
    "constant_thickness": shape_constant_thickness,
    "braid_of_constant_thickness": shape_braid_of_constant_thickness,
    "braid_of_thin_wall": shape_braid_of_thin_wall,
    "braid_of_thin_section": shape_braid_of_thin_section,
}
"""The two kinematics by their declared names, and three that an effect asks for."""

NEWTON_STEPS = 6
FLATTEST = 0.1
"""Least slope in these steps: where longer tips leave no working length at all they must end somewhere."""


def tip_shortened_length_of_its_own(L: Array, kinematics: str, rest: Rest, factor: Array) -> Array:
    """Working length (m) whose own radius rounds the tips: L′ = L − 2·factor·(π/2 − 1)(R(L′) − R0).

    Eq. 2.47 with the radius of Eq. 2.10 or 4.16 at L′ in place of that at L; by Newton's method.
    """
    shape, least, step = SHAPES[kinematics], SHORTEST * rest.L0, 1e-5 * rest.L0
    working = L
    for _ in range(NEWTON_STEPS):
        at = np.maximum(working, least)
        R, further = shape(at, rest).R, shape(at + step, rest).R
        gap = working - tip_shortened_length(L, R, rest, factor)
        slope = 1.0 + 2.0 * factor * (np.pi / 2.0 - 1.0) * (further - R) / step
        working = working - gap / np.maximum(slope, FLATTEST)
    return np.asarray(working)
