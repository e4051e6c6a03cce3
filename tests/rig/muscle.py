"""The declared simulation of a braided muscle, from its definition.

F = P pi [R^2 (2T-1) + (2Rt - t^2) - 2 t R T] + pi (2Rt - t^2) s(z) - 2 pi R t T s(x)
with T = tan^2(alpha), sin(alpha) = L/B and s(e) = sum_k E_k(P) e^k.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
KPA = 1e-3  # kPa -> N/mm2
PA = 1e-6  # Pa -> N/mm2


@dataclass(frozen=True)
class Geometry:
    """Outer radius R0, wall t0, active length L0 [mm]; braid angle alpha0 from the hoop direction [deg].

    The angle may be an array with one value per row where an effect makes it vary over the test.
    """

    L0_mm: float
    R0_mm: float
    t0_mm: float
    alpha0_deg: float | Array


@dataclass(frozen=True)
class Braid:
    """Strands: modulus [GPa], Poisson ratio, strand radius [mm], number of strands."""

    E_br_GPa: float
    nu_s: float
    R_br_mm: float
    n: int


@dataclass(frozen=True)
class Law:
    """Moduli against pressure (kPa), one row of constants per order k, in Pa.

    constant: (E,); linear: (a, b) with a P + b; exponential: (c, w) with rates (d, z) shared by all k;
    exponential_each: (c, d, w, z); free: one value per entry of `levels_kPa` (nearest level counts).
    """

    name: str
    constants: tuple[tuple[float, ...], ...]
    rates: tuple[float, float] = (0.0, 0.0)
    levels_kPa: tuple[float, ...] = ()

    @property
    def order(self) -> int:
        return len(self.constants)

    def moduli(self, pressure_kPa: Array, setpoint_kPa: Array) -> Array:
        """E_k in Pa as an array (order, rows)."""
        c = np.asarray(self.constants, dtype=float)[:, :, None]
        p = np.asarray(pressure_kPa, dtype=float)
        if self.name == "constant":
            return c[:, 0] + 0.0 * p
        if self.name == "linear":
            return c[:, 0] * p + c[:, 1]
        if self.name == "exponential":
            d, z = self.rates
            return c[:, 0] * np.exp(d * p) + c[:, 1] * np.exp(z * p)
        if self.name == "exponential_each":
            return c[:, 0] * np.exp(c[:, 1] * p) + c[:, 2] * np.exp(c[:, 3] * p)
        if self.name == "free":
            nearest = np.abs(np.asarray(setpoint_kPa)[:, None] - np.asarray(self.levels_kPa)).argmin(axis=1)
            return c[:, :, 0][:, nearest]
        raise ValueError(f"unknown law {self.name}")


@dataclass(frozen=True)
class Simulation:
    """What the specimen file declares, with the values the muscle really has for the declared terms.

    `friction_value` is K_f or f_s: one number, or one per level when `friction_by_pressure`.
    `source` "tensile" declares `declared_E_Pa` with the common relative sd `E_rel_sd`; `law` holds the true
    moduli.
    """

    kinematics: str = "inextensible_braid"
    strain: str = "engineering"
    friction: str = "coulomb"
    friction_value: tuple[float, ...] = (0.06,)
    friction_by_pressure: bool = False
    source: str = "tensile"
    law: Law = Law("constant", ((1e5,),))
    declared_E_Pa: tuple[float, ...] = ()
    E_rel_sd: float = 0.1


@dataclass(frozen=True)
class Muscle:
    """Geometry, strands and declared simulation of one base muscle."""

    name: str
    geometry: Geometry
    braid: Braid | None
    simulation: Simulation

    def with_simulation(self, **changes: Any) -> Muscle:
        """The same muscle with some fields of the simulation changed."""
        return replace(self, simulation=replace(self.simulation, **changes))


@dataclass(frozen=True)
class Shape:
    """Deformed shape per row: length L and outer radius R and wall t [mm], T = tan^2(alpha)."""

    L: Array
    R: Array
    t: Array
    T: Array


def radius_constant_thickness(g: Geometry, length: Array) -> Array:
    """R [mm] from L0 (2 R0 t - t^2) = L (2 R t - t^2) with t = t0 (Eq. 4.16)."""
    section = g.L0_mm * (2.0 * g.R0_mm * g.t0_mm - g.t0_mm**2) / length
    return (section + g.t0_mm**2) / (2.0 * g.t0_mm)


def radius_strands(g: Geometry, length: Array, stretch: Array | float = 1.0) -> Array:
    """R [mm] from (2 pi N R)^2 + L^2 = B^2 (Eq. 2.10); strands longer by the factor `stretch`."""
    alpha0 = np.radians(g.alpha0_deg)
    strand = g.L0_mm / np.sin(alpha0)
    turns = strand * np.cos(alpha0) / g.R0_mm  # 2 pi N
    return np.sqrt(np.maximum((strand * stretch) ** 2 - length**2, 1e-12)) / turns


def wall_of_constant_volume(g: Geometry, length: Array, radius: Array) -> Array:
    """t [mm] from L (2Rt - t^2) = L0 (2 R0 t0 - t0^2)."""
    section = g.L0_mm * (2.0 * g.R0_mm * g.t0_mm - g.t0_mm**2) / length
    return radius - np.sqrt(np.maximum(radius**2 - section, 0.0))


def shape_of(g: Geometry, length: Array, kinematics: str, stretch: Array | float = 1.0) -> Shape:
    """Shape at length L [mm] for the declared kinematics."""
    sine = np.clip(length * np.sin(np.radians(g.alpha0_deg)) / (g.L0_mm * stretch), 0.0, 0.9999)
    T = sine**2 / (1.0 - sine**2)
    if kinematics == "constant_thickness":
        return Shape(length, radius_constant_thickness(g, length), np.full_like(length, g.t0_mm), T)
    if kinematics == "inextensible_braid":
        radius = radius_strands(g, length, stretch)
        return Shape(length, radius, wall_of_constant_volume(g, length, radius), T)
    raise ValueError(f"unknown kinematics {kinematics}")


def strains(g: Geometry, s: Shape, convention: str) -> tuple[Array, Array]:
    """(axial z, hoop x): engineering strains, or stretches."""
    shift = {"engineering": 1.0, "stretch": 0.0}[convention]
    return s.L / g.L0_mm - shift, s.R / g.R0_mm - shift


def gas_force(pressure_kPa: Array, s: Shape, thickness: Array | float = 1.0) -> Array:
    """Gas force [N]; `thickness` scales the term (2Rt - t^2) - 2tRT."""
    wall = (2.0 * s.R * s.t - s.t**2) - 2.0 * s.t * s.R * s.T
    return pressure_kPa * KPA * np.pi * (s.R**2 * (2.0 * s.T - 1.0) + thickness * wall)


def polynomial_stress(moduli_Pa: Array, strain: Array) -> Array:
    """sum_k E_k e^k in N/mm2, k from 1."""
    total = np.zeros_like(strain)
    for modulus in moduli_Pa[::-1]:
        total = (total + modulus) * strain
    return total * PA


def wall_force(s: Shape, axial: Array, hoop: Array) -> Array:
    """Force [N] of the wall's axial and hoop stresses [N/mm2]."""
    return np.pi * (2.0 * s.R * s.t - s.t**2) * axial - 2.0 * np.pi * s.R * s.t * s.T * hoop


def static_force(m: Muscle, pressure_kPa: Array | float, contraction: Array | float) -> Array:
    """Friction-free force [N] of the declared simulation at pressure [kPa] and contraction gamma."""
    p, gamma = np.broadcast_arrays(np.asarray(pressure_kPa, float), np.asarray(contraction, float))
    p, gamma = p.ravel(), gamma.ravel()
    s = shape_of(m.geometry, m.geometry.L0_mm * (1.0 - gamma), m.simulation.kinematics)
    z, x = strains(m.geometry, s, m.simulation.strain)
    E = m.simulation.law.moduli(p, p)
    return gas_force(p, s) + wall_force(s, polynomial_stress(E, z), polynomial_stress(E, x))


def strand_friction(
    g: Geometry,
    b: Braid,
    pressure_kPa: Array,
    contraction: Array,
    power: float = 1.0 / 3.0,
    flat: bool = False,
) -> Array:
    """|F_f| / f_s [N]: P 2 pi R0 L0 cos(a0) / sqrt(1 - sin^2(a0)(1-g)^2) / (1-g) / 0.69 (P(1-nu^2)/E)^power.

    Eq. 2.43 as printed for power 1/3. `flat` leaves out the change of the contact surface with contraction.
    """
    a0 = np.radians(g.alpha0_deg)
    P = np.maximum(pressure_kPa, 0.0) * KPA
    ratio = P * (1.0 - b.nu_s**2) / (b.E_br_GPa * 1e3)
    surface: Array | float = 2.0 * np.pi * g.R0_mm * g.L0_mm
    if not flat:
        root = np.sqrt(np.maximum(1.0 - (np.sin(a0) * (1.0 - contraction)) ** 2, 1e-9))
        surface = surface * np.cos(a0) / root / (1.0 - contraction)
    return P * surface / 0.69 * ratio**power


def free_contraction(m: Muscle, pressure_kPa: float, limit: float = 0.45) -> float:
    """First root of the friction-free curve, 0 where it starts at or below 0, `limit` where there is none."""
    grid = np.linspace(0.0, limit, 451)
    force = static_force(m, np.full(grid.size, pressure_kPa), grid)
    if force[0] <= 0.0:
        return 0.0
    below = np.flatnonzero(force <= 0.0)
    if below.size == 0:
        return limit
    j = int(below[0])
    return float(grid[j - 1] + (grid[j] - grid[j - 1]) * force[j - 1] / (force[j - 1] - force[j]))
