"""A muscle outside the model class, for the coverage of calibrated bands.

The wall is a hyperelastic tube (Mooney-Rivlin or Yeoh) and the friction a seal-like mix of pressure, force
and position, so neither the stress polynomial nor F + K_f |F| s holds. Truth is exact by construction:
F = gas + pi (2Rt - t^2) s_z - 2 pi R t T s_h, stretches l_z = L/L0, l_h = R/R0, l_r = 1/(l_z l_h).
"""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .muscle import Array, Braid, Geometry, gas_force, shape_of, wall_force
from .specimens import FAMILIES, geometry_of

LEVEL_SHARES = (0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0)


@dataclass(frozen=True)
class HyperelasticMuscle:
    """Geometry, braid, wall constants in N/mm2 (C1, C2 Mooney-Rivlin; C1, C3 Yeoh) and friction shares."""

    geometry: Geometry
    braid: Braid
    wall: str
    C1: float
    C2: float
    drag: float
    share: float
    top_kPa: float

    def stresses(self, axial: Array, hoop: Array) -> tuple[Array, Array]:
        """Axial and hoop stress less the radial one [N/mm2] at the stretches."""
        radial = 1.0 / (axial * hoop)
        if self.wall == "mooney_rivlin":
            return (
                2.0 * (axial**2 - radial**2) * (self.C1 + self.C2 * hoop**2),
                2.0 * (hoop**2 - radial**2) * (self.C1 + self.C2 * axial**2),
            )
        first = axial**2 + hoop**2 + radial**2 - 3.0
        slope = 2.0 * (self.C1 + 2.0 * self.C2 * first)
        return slope * (axial**2 - radial**2), slope * (hoop**2 - radial**2)

    def uniaxial(self, strain: Array) -> Array:
        """Engineering stress [Pa] of a strip at the engineering strain."""
        k = 1.0 + strain
        if self.wall == "mooney_rivlin":
            stress = 2.0 * (k - k**-2) * (self.C1 + self.C2 / k)
        else:
            stress = 2.0 * (k - k**-2) * (self.C1 + 2.0 * self.C2 * (k**2 + 2.0 / k - 3.0))
        return 1e6 * stress

    def force(self, pressure_kPa: Array, contraction: Array) -> Array:
        """Friction-free force [N]."""
        p, gamma = np.broadcast_arrays(np.asarray(pressure_kPa, float), np.asarray(contraction, float))
        s = shape_of(self.geometry, self.geometry.L0_mm * (1.0 - gamma), "inextensible_braid")
        axial, hoop = self.stresses(s.L / self.geometry.L0_mm, s.R / self.geometry.R0_mm)
        return gas_force(p, s) + wall_force(s, axial, hoop)

    def friction(self, pressure_kPa: Array, contraction: Array) -> Array:
        """|friction| [N]: a drag with P^0.7 that fades with contraction, and |F|^0.85."""
        blocked = float(self.force(np.array(self.top_kPa), np.array(0.0)))
        force = np.abs(self.force(pressure_kPa, contraction)) / blocked
        part = (np.asarray(pressure_kPa) / self.top_kPa) ** 0.7 * (1.0 - 0.8 * np.asarray(contraction))
        return blocked * (self.drag * part + self.share * force**0.85)

    def free_contraction(self, pressure_kPa: float) -> float:
        """First root of the friction-free curve (0 where there is none)."""
        grid = np.linspace(0.0, 0.42, 1681)
        force = self.force(np.full(grid.size, pressure_kPa), grid)
        below = np.flatnonzero(force <= 0.0)
        if below.size == 0 or below[0] == 0:
            return 0.0
        j = int(below[0])
        return float(grid[j - 1] + (grid[j] - grid[j - 1]) * force[j - 1] / (force[j - 1] - force[j]))


def hyperelastic_muscle(seed: int) -> HyperelasticMuscle:
    """A muscle whose free contraction at the highest level lies near 0.75 of the wall-less one."""
    rng = random.Random(f"calibration-{seed}")
    g, b, top = geometry_of(FAMILIES[rng.choice(sorted(FAMILIES))], rng)
    wall = rng.choice(("mooney_rivlin", "yeoh"))
    drag, share, ratio = rng.uniform(0.01, 0.03), rng.uniform(0.02, 0.06), rng.uniform(0.05, 0.3)

    def made(c1: float) -> HyperelasticMuscle:
        return HyperelasticMuscle(
            g, b, wall, c1, (ratio if wall == "mooney_rivlin" else 0.1 * ratio) * c1, drag, share, top
        )

    target = rng.uniform(0.65, 0.85) * made(1e-9).free_contraction(top)
    low, high = 1e-6, 5.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if made(middle).free_contraction(top) > target else (low, middle)
    return made(0.5 * (low + high))


def _loops(m: HyperelasticMuscle, levels: list[float], noise: float, rng: np.random.Generator) -> str:
    out = ["time_s,pressure_kPa,displacement_mm,force_N,setpoint_kPa,cycle,branch"]
    clock = 0.0
    for level in levels:
        stroke = 0.9 * m.free_contraction(level)
        for cycle in (1, 2):
            for sign in (-1.0, 1.0):
                way = np.linspace(0.0, stroke, 60, endpoint=False)
                gamma = way if sign < 0 else stroke - way
                pressure = np.full(gamma.size, level)
                force = m.force(pressure, gamma) + sign * m.friction(pressure, gamma)
                force = force + noise * rng.standard_normal(gamma.size)
                branch = "loading" if sign > 0 else "unloading"
                for x, f in zip(gamma * m.geometry.L0_mm, force, strict=True):
                    out.append(f"{clock:.3f},{level:.4f},{x:.6f},{f:.6f},{level:g},{cycle},{branch}")
                    clock += 0.2
        clock += 15.0
    return "\n".join(out) + "\n"


def _table(header: str, *columns: Array) -> str:
    lines = [",".join(f"{v:.6g}" for v in row) for row in zip(*columns, strict=True)]
    return "\n".join([header, *lines]) + "\n"


def _toml(
    m: HyperelasticMuscle, name: str, noise: float, files: dict[str, str], strain: str, order: int
) -> str:
    g, b = m.geometry, m.braid
    listed = "\n".join(f'{k} = "{v}"' for k, v in files.items())
    return (
        f'[specimen]\nname = "{name}"\n\n[geometry]\nL0_mm = {g.L0_mm!r}\nR0_mm = {g.R0_mm!r}\n'
        f"t0_mm = {g.t0_mm!r}\nalpha0_deg = {g.alpha0_deg!r}\n\n[braid]\nE_br_GPa = {b.E_br_GPa!r}\n"
        f"nu_s = {b.nu_s!r}\nR_br_mm = {b.R_br_mm!r}\nn = {b.n}\n\n"
        f"[sensors]\nforce_sd_N = {noise:.4g}\n\n"
        f'[files]\n{listed}\n\n[simulation]\nkinematics = "inextensible_braid"\nstrain = "{strain}"\n'
        f'friction = "coulomb"\nfriction_by_pressure = false\neffects = []\nmoduli = "loops"\n'
        f'order = {order}\nlaw = "linear"\n'
    )


def _files(m: HyperelasticMuscle, levels: list[float], noise: float, seed: int) -> dict[str, str]:
    rng = np.random.default_rng([seed, 41])
    p = np.repeat(levels, 16)
    gamma = np.concatenate([np.linspace(0.0, 0.95 * m.free_contraction(v), 16) for v in levels])
    strain = np.linspace(0.05, 1.5, 40)
    stress = m.uniaxial(strain)
    every = np.array(levels)
    blocked = m.force(every, np.zeros(every.size))
    free = np.array([m.free_contraction(v) for v in levels])

    def noisy(values: Array, sd: float) -> Array:
        return values + sd * rng.standard_normal(values.size)

    make: dict[str, Callable[[], str]] = {
        "loops": lambda: _loops(m, levels, noise, rng),
        "force_map": lambda: _table(
            "pressure_kPa,contraction,force_N", p, gamma, noisy(m.force(p, gamma), noise)
        ),
        "blocked_force": lambda: _table("pressure_kPa,force_N", every, noisy(blocked, noise)),
        "free_contraction": lambda: _table("pressure_kPa,contraction", every, noisy(free, 5e-4)),
        "tensile": lambda: _table("strain,stress_Pa", strain, noisy(stress, 0.01 * float(stress.max()))),
    }
    return {kind: text() for kind, text in make.items()}


def write_calibration_case(
    seed: int,
    folder: Path,
    held_out: Path,
    kinds: tuple[str, ...] = ("loops",),
    strain: str = "engineering",
    order: int = 3,
) -> dict[str, Any]:
    """Write a specimen of `kinds` of files, and one with the held-out pressure levels; return the truth.

    Fitted levels are every other share of the highest, held-out ones those between: all inside the fitted
    range. The truth holds, per level, friction-free force and friction on a grid of contraction.
    """
    m = hyperelastic_muscle(seed)
    levels = [round(m.top_kPa * share, 1) for share in LEVEL_SHARES]
    noise = 0.003 * float(m.force(np.array(m.top_kPa), np.array(0.0)))
    truth: dict[str, Any] = {
        "wall": m.wall,
        "C1_MPa": m.C1,
        "C2_MPa": m.C2,
        "noise_N": noise,
        "top_kPa": m.top_kPa,
        "levels": {},
    }
    parts = ((Path(folder), levels[0::2], 0), (Path(held_out), levels[1::2], 1))
    for place, chosen, part in parts:
        place.mkdir(parents=True, exist_ok=True)
        texts = _files(m, chosen, noise, 2 * seed + part)
        names = {kind: f"{kind}.csv" for kind in kinds}
        for kind, name in names.items():
            (place / name).write_text(texts[kind], encoding="utf-8")
        (place / "specimen.toml").write_text(
            _toml(m, f"hyperelastic-{seed}", noise, names, strain, order), encoding="utf-8"
        )
    curves = {}
    for level in levels:
        gamma = np.linspace(0.0, m.free_contraction(level), 41)
        p = np.full(gamma.size, level)
        curves[level] = {
            "contraction": gamma.tolist(),
            "force_N": m.force(p, gamma).tolist(),
            "friction_N": m.friction(p, gamma).tolist(),
            "held_out": level in levels[1::2],
        }
    truth["levels"] = curves
    return truth
