"""Small specimen folders for runs from end to end: a muscle of known moduli, a few hundred rows a level."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

L0, R0, T0, ALPHA0 = 50.0, 3.0, 0.7, 72.0
"""The muscle at rest: mm and degrees."""
Moduli = tuple[tuple[float, float], ...]
MODULI: Moduli = ((400.0, 1.6e5), (150.0, 4.0e4))
"""E_k = a_k P + b_k, P in kPa, E in Pa."""
MATERIAL: Moduli = ((0.0, 2.2e5), (0.0, 6.0e4))
"""Moduli that do not depend on pressure, those of the tensile test."""
K_F = 0.05
NOISE_N = 0.05
LEVELS = (100.0, 150.0, 200.0)

GEOMETRY = f"""\
[geometry]
L0_mm = {L0}
R0_mm = {R0}
t0_mm = {T0}
alpha0_deg = {ALPHA0}
"""
SIMULATION = """\
[simulation]
kinematics = "inextensible_braid"
strain = "engineering"
friction = "coulomb"
moduli = "loops"
order = 2
law = "linear"
"""


def static_force(pressure_kPa: Array, contraction: Array, moduli: Moduli = MODULI) -> Array:
    """Friction-free force (N) of the declared simulation: inextensible braid, engineering strain."""
    pressure = 1e3 * pressure_kPa
    turns_length = L0 / np.sin(np.radians(ALPHA0))
    length = L0 * (1.0 - contraction)
    radius = R0 * np.sqrt(turns_length**2 - length**2) / np.sqrt(turns_length**2 - L0**2)
    wall = radius - np.sqrt(radius**2 - (2.0 * R0 * T0 - T0**2) * L0 / length)
    tangent = length**2 / (turns_length**2 - length**2)
    ring = 2.0 * radius * wall - wall**2

    def stress(strain: Array) -> Array:
        return sum(
            ((a * pressure_kPa + b) * strain ** (k + 1) for k, (a, b) in enumerate(moduli)), 0.0 * strain
        )

    square_metres = 1e-6 * np.pi
    gas = pressure * (radius**2 * (2.0 * tangent - 1.0) + ring - 2.0 * tangent * radius * wall)
    along, around = stress(length / L0 - 1.0), stress(radius / R0 - 1.0)
    return square_metres * (gas + ring * along - 2.0 * radius * wall * tangent * around)


def free_contraction(pressure_kPa: float, moduli: Moduli = MODULI) -> float:
    """First root of the friction-free force (0 where it does not pull)."""
    grid = np.linspace(0.0, 0.5, 5001)
    below = static_force(np.full(grid.shape, pressure_kPa), grid, moduli) <= 0.0
    return float(grid[below.argmax()])


@dataclass(frozen=True)
class Specimen:
    """What a small specimen folder declares beside its files."""

    name: str = "Small muscle"
    tables: str = ""
    geometry: str = GEOMETRY
    simulation: str = SIMULATION

    def write(self, folder: Path, **files: str) -> Path:
        """The folder with its declaration and its files (kind to CSV text)."""
        folder.mkdir(parents=True)
        listed = "".join(f'{kind} = "{kind}.csv"\n' for kind in files)
        parts = [f'[specimen]\nname = "{self.name}"\n', self.geometry, self.tables]
        parts += [f"[files]\n{listed}" if files else "", self.simulation]
        (folder / "specimen.toml").write_text("\n".join(part for part in parts if part))
        for kind, text in files.items():
            (folder / f"{kind}.csv").write_text(text)
        return folder


def csv_text(columns: dict[str, Array | list[str]]) -> str:
    """A CSV's text from named columns."""
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(v if isinstance(v, str) else f"{v:.6g}" for v in row) for row in rows]
    return "\n".join([",".join(columns), *lines]) + "\n"


def loops_text(
    seed: int = 0, rows: int = 150, levels: tuple[float, ...] = LEVELS, moduli: Moduli = MODULI
) -> str:
    """One cycle a level: from free contraction back to L0 and out again, ``rows`` each way."""
    rng = np.random.default_rng(seed)
    parts, start = [], 0.0
    for level in levels:
        back = np.linspace(0.98 * free_contraction(level, moduli), 0.0, rows)
        contraction = np.concatenate([back, back[::-1]])
        sign = np.repeat([1.0, -1.0], rows)
        pressure = np.full(2 * rows, level)
        force = static_force(pressure, contraction, moduli)
        force = force + K_F * np.abs(force) * sign + NOISE_N * rng.standard_normal(2 * rows)
        time = start + 0.1 * np.arange(2 * rows)
        start = time[-1] + 5.0
        parts.append([time, pressure, L0 * contraction, force])
    names = ("time_s", "pressure_kPa", "displacement_mm", "force_N")
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return csv_text(dict(zip(names, joined, strict=True)))


def map_text(seed: int = 0, levels: tuple[float, ...] = LEVELS) -> str:
    """A static force map: fifteen lengths a level."""
    rng = np.random.default_rng(seed)
    pressure = np.repeat(levels, 15)
    contraction = np.concatenate([np.linspace(0.0, 0.95 * free_contraction(level), 15) for level in levels])
    force = static_force(pressure, contraction) + NOISE_N * rng.standard_normal(len(pressure))
    return csv_text({"pressure_kPa": pressure, "contraction": contraction, "force_N": force})


def tensile_text(seed: int = 0) -> str:
    """A tensile test of the material."""
    rng = np.random.default_rng(seed)
    strain = np.linspace(0.0, 1.0, 200)
    return csv_text({"strain": strain, "stress_Pa": stress_Pa(strain) + 100.0 * rng.standard_normal(200)})


def stress_Pa(strain: Array) -> Array:
    """The material's stress."""
    return np.asarray(sum(b * strain ** (k + 1) for k, (_, b) in enumerate(MATERIAL)))
