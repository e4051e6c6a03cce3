"""Specimen folders for the tests: a good one, and helpers to spoil it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

DECLARATION = """\
[specimen]
name = "Test muscle"

[geometry]
L0_mm = 50.0
R0_mm = 3.0
t0_mm = 0.7
alpha0_deg = 72.0

[files]
loops = "loops.csv"

[simulation]
friction = "coulomb"
order = 2
law = "linear"
"""

HEADER = "time_s,pressure_kPa,displacement_mm,force_N"


@dataclass(frozen=True)
class Recording:
    """Synthetic loops with the truth beside them; every array has shape (rows,)."""

    time: NDArray[np.float64]
    pressure: NDArray[np.float64]
    displacement: NDArray[np.float64]
    force: NDArray[np.float64]
    branch: NDArray[np.int64]
    cycle: NDArray[np.int64]

    def columns(self) -> NDArray[np.float64]:
        return np.column_stack([self.time, self.pressure, self.displacement, self.force])

    def text(self, header: str = HEADER, delimiter: str = ",") -> str:
        lines = [delimiter.join(f"{value:.5f}" for value in row) for row in self.columns()]
        return "\n".join([header.replace(",", delimiter), *lines]) + "\n"


def loops(
    levels: tuple[float, ...] = (50.0, 100.0, 150.0),
    cycles: int = 1,
    speeds: tuple[float, ...] = (0.8,),
    dwell: int = 0,
    encoder_sd: float = 0.0,
    quantum: float = 0.0,
    pressure_sd: float = 0.0,
    wander: float = 0.0,
    rate: float = 10.0,
    start_t: float = 0.0,
    seed: int = 0,
) -> Recording:
    """Triangles from L0 to a level's free contraction and back, with holds of ``dwell`` rows."""
    rng = np.random.default_rng(seed)
    x, p, b, c = [], [], [], []
    for level in levels:
        number = 0
        for speed in speeds:
            top = 5.0 + 0.05 * level
            steps = max(3, int(top / speed * rate))
            up = np.linspace(0.0, top, steps)
            for _ in range(cycles):
                number += 1
                x.append(np.concatenate([up, np.full(dwell, top), up[::-1], np.zeros(dwell)]))
                b.append(np.repeat([-1, 1], steps + dwell))
                c.append(np.full(2 * (steps + dwell), number))
                phase = np.linspace(0.0, 2.0 * np.pi, 2 * (steps + dwell))
                p.append(level * (1.0 + wander * np.sin(phase)))
    displacement, pressure = np.concatenate(x), np.concatenate(p)
    branch, cycle = np.concatenate(b), np.concatenate(c)
    force = 0.3 * pressure * (1.0 - displacement / 20.0) * (1.0 + 0.05 * branch)
    displacement = displacement + encoder_sd * rng.normal(size=len(displacement))
    if quantum:
        displacement = np.round(displacement / quantum) * quantum
    pressure = pressure + pressure_sd * rng.normal(size=len(pressure))
    time = start_t + np.arange(len(branch)) / rate
    return Recording(time, pressure, displacement, force, branch, cycle)


def make(folder: Path, declaration: str = DECLARATION, **files: str) -> Path:
    """Write a specimen folder: ``files`` maps kinds (``loops``) to the text of their CSV."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "specimen.toml").write_text(declaration)
    for kind, text in files.items():
        (folder / f"{kind}.csv").write_text(text)
    return folder


def good(folder: Path) -> Path:
    return make(folder, loops=loops().text())
