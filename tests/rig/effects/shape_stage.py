"""Effects on the muscle's shape: end pieces, kinematics, braid angle, stretching strands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..chain import Form, State
from ..muscle import KPA, Array, Geometry, Muscle, Shape, radius_strands, shape_of, wall_of_constant_volume
from ..protocol import Rows

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


# --- end pieces: factor on the length they take ------------------------------------------------------------


def _circular_tip(g: Geometry, radius: Array) -> Array:
    """2 (pi/2 - 1)(R - R0): quarter circles (Eq. 2.47)."""
    return 2.0 * (np.pi / 2.0 - 1.0) * (radius - g.R0_mm)


def _elliptic_tip(g: Geometry, radius: Array) -> Array:
    """Arc minus axial length of quarter ellipses, axial half-axis 0.5 R0 + 0.5 (R - R0), both ends."""
    rise = radius - g.R0_mm
    axial = 0.5 * g.R0_mm + 0.5 * np.abs(rise)
    angle = 0.5 * np.pi * _NODES[:, None]
    speed = np.sqrt((axial * np.cos(angle)) ** 2 + (rise * np.sin(angle)) ** 2)
    arc = 0.5 * np.pi * (_WEIGHTS[:, None] * speed).sum(axis=0)
    return 2.0 * np.sign(rise) * (arc - axial)


def _cosine_tip(g: Geometry, radius: Array) -> Array:
    """Arc minus axial length of r = R0 + (R-R0)(1 - cos(pi z/h))/2 over h = 0.7 R, integrated, both ends."""
    rise, h = radius - g.R0_mm, 0.7 * radius
    slope = 0.5 * np.pi * rise / h * np.sin(np.pi * _NODES[:, None])
    arc = h * (_WEIGHTS[:, None] * np.sqrt(1.0 + slope**2)).sum(axis=0)
    return 2.0 * np.sign(rise) * (arc - h)


def _conical_tip(g: Geometry, radius: Array) -> Array:
    """Arc minus axial length of cones of axial length 0.4 R0, both ends."""
    rise, h = radius - g.R0_mm, 0.4 * g.R0_mm
    return 2.0 * np.sign(rise) * (np.hypot(h, rise) - h)


def _tip(profile: Callable[[Geometry, Array], Array]) -> Callable[[State, float], None]:
    def apply(state: State, size: float) -> None:
        state.tip = lambda g, radius: size * profile(g, radius)

    return apply


# --- kinematics: the radius follows the strands ------------------------------------------------------------


def _mixed(size: float, other: Shape, base: Shape) -> Shape:
    return Shape(base.L, base.R + size * (other.R - base.R), base.t + size * (other.t - base.t), base.T)


def _follow(kind: str) -> Callable[[State, float], None]:
    def build(state: State, g: Geometry, length: Array, stretch: Array | float) -> Shape:
        if kind == "strands":
            return shape_of(g, length, "inextensible_braid", stretch)
        T = shape_of(g, length, "inextensible_braid", stretch).T
        if kind == "centreline":  # the strands' axis, not the liner's skin, keeps its length
            gap = state.muscle.braid.R_br_mm if state.muscle.braid else 0.05 * g.R0_mm
            axis = Geometry(g.L0_mm, g.R0_mm + gap, g.t0_mm, g.alpha0_deg)
            radius = radius_strands(axis, length, stretch) - gap
        else:  # "packed": the braid packs at large radius and lags by up to 6 %
            radius = radius_strands(g, length, stretch)
            radius = radius * (1.0 - 0.06 * np.clip(radius / g.R0_mm - 1.0, 0.0, 1.0))
        return Shape(length, radius, wall_of_constant_volume(g, length, radius), T)

    def apply(state: State, size: float) -> None:
        declared = state.muscle.simulation.kinematics
        state.shape = lambda g, length, stretch: _mixed(
            size, build(state, g, length, stretch), shape_of(g, length, declared, stretch)
        )

    return apply


# --- braid angle: true minus declared [deg] ----------------------------------------------------------------


def _angle(state: State, size: float) -> None:
    state.angle_drift = state.angle_drift + size


def _two_families(state: State, size: float) -> None:
    """The two strand families differ: half the section at 0.4, half at 1.6 times the deviation."""
    state.angles = [(0.4 * size, 0.5), (1.6 * size, 0.5)]


def _bedding(state: State, size: float) -> None:
    """The braid beds in as the pressure rises: 0.75 + 0.25 P/P_max of the deviation."""
    share = state.pressure / float(state.rows.setpoint.max())
    state.angle_drift = state.angle_drift + size * (0.75 + 0.25 * share)


# --- strands that stretch: factor on their compliance ------------------------------------------------------


def strand_energy_force(m: Muscle, g: Geometry, length: Array, pressure: Array) -> Array:
    """L/(E A n) 4 pi^2 P^2 B^3 / (2 pi N)^4 in N (Eq. 2.25)."""
    if m.braid is None:
        raise ValueError("stretching strands need the braid")
    a0 = np.radians(g.alpha0_deg)
    strand = g.L0_mm / np.sin(a0)
    turns = strand * np.cos(a0) / g.R0_mm
    stiffness = m.braid.E_br_GPa * 1e3 * np.pi * m.braid.R_br_mm**2 * m.braid.n
    return length / stiffness * 4.0 * np.pi**2 * (pressure * KPA) ** 2 * strand**3 / turns**4


def _energy(state: State, size: float) -> None:
    m = state.muscle
    state.statics.append(lambda g, length, p: -size * strand_energy_force(m, g, length, p))


def _stretching(crimped: bool) -> Callable[[State, float], None]:
    """The shape is solved with strands of length B (1 + e), e = factor x tension / (E A).

    Hoop balance P R L = (n N) tension cos(alpha) gives tension = 2 pi P B L / (n (2 pi N)^2). `crimped`
    strands straighten first: three times as compliant at no load, easing off with the load.
    """

    def apply(state: State, size: float) -> None:
        braid = state.muscle.braid
        if braid is None:
            raise ValueError("stretching strands need the braid")
        section = braid.E_br_GPa * 1e3 * np.pi * braid.R_br_mm**2
        top = float(state.rows.setpoint.max()) * KPA

        def stretch(g: Geometry, length: Array, pressure: Array) -> Array:
            a0 = np.radians(g.alpha0_deg)
            strand = g.L0_mm / np.sin(a0)
            turns = strand * np.cos(a0) / g.R0_mm
            full = top * 2 * np.pi * strand * g.L0_mm / (braid.n * turns**2)
            e: Array = np.zeros_like(length)
            for _ in range(6):
                tension = pressure * KPA * 2 * np.pi * strand * (1.0 + e) * length / (braid.n * turns**2)
                ease = 1.0 + 2.0 * np.exp(-3.0 * tension / full) if crimped else 1.0
                e = size * tension / section * ease
            return 1.0 + e

        state.stretch = stretch

    return apply


def _constant(value: float) -> Callable[[Muscle, Rows], float]:
    return lambda m, rows: value


def _form(
    effect: str,
    name: str,
    parameter: str,
    apply: Callable[[State, float], None],
    unit: float,
    stage: str = "shape",
    **more: Any,
) -> Form:
    return Form(effect, name, parameter, stage, apply, _constant(unit), **more)


FORMS: tuple[Form, ...] = (
    *(
        _form("tip_shape", name, "tip_factor", _tip(profile), 0.5, high=3.0, shared=name == "circular")
        for name, profile in (
            ("circular", _circular_tip),
            ("elliptic", _elliptic_tip),
            ("cosine", _cosine_tip),
            ("conical", _conical_tip),
        )
    ),
    *(
        _form("braid_kinematics", name, "", _follow(name), 1.0, low=1.0, high=1.0, shared=name == "strands")
        for name in ("strands", "centreline", "packed")
    ),
    *(
        _form("braid_angle", name, "delta_alpha_deg", apply, 0.5, signed=True, shared=name == "uniform")
        for name, apply in (("uniform", _angle), ("two_families", _two_families), ("bedding", _bedding))
    ),
    *(
        _form("braid_stretch", name, "braid_factor", apply, 1.0, shared=name == "energy")
        for name, apply in (
            ("energy", _energy),
            ("balance", _stretching(False)),
            ("crimped", _stretching(True)),
        )
    ),
)
