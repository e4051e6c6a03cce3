"""Rebuild the two RECONSTRUCTED data sets, and the copies of the thesis's tables, byte for byte.

    python datasets/rebuild.py [FOLDER]

The thesis's measured loops are lost. What survives are the moduli of its Tables 4.3 and 4.7, which decode to
the average force curves (see mpam_calib.thesis.decoded), and its friction. This script runs the thesis's
protocol on those curves: five levels, from free contraction to L0 and back at 50 mm/min, 100 Hz, with noise
of the size its instruments have. Nothing here was measured.
"""

from __future__ import annotations

import sys
from importlib.resources import files
from pathlib import Path

import numpy as np

from mpam_calib.thesis import decoded
from mpam_calib.units import KPA, MINUTE, MM

SPEED = 50 * MM / MINUTE
RATE = 100.0
PAUSE = 60.0
"""Crosshead speed (m/s, thesis 4.6), sampling rate (Hz, 4.6), time between two levels (s, ours)."""

FORCE_WHITE, FORCE_CORRELATED, CORRELATION_TIME = 0.20, 0.15, 0.1
"""Load cell noise, N, N, s: white and short correlated, together 0.25 N = 0.1 % of 250 N (thesis 4.3)."""
PRESSURE_NOISE = 50.0
"""White noise of the pressure reading, Pa. The gauge's unknown constant offset is declared, not added."""

SEEDS = {"MPAM1": 41, "MPAM2": 42}
HEADER = "time_s,setpoint_kPa,pressure_kPa,displacement_mm,force_N,cycle,branch"


def friction(muscle: str, level: int, gamma: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Magnitude of the friction, N: Coulomb's K_f of Table 4.10, or the strands' of Eq. 4.14."""
    if muscle == "MPAM1":
        return decoded.coulomb_factors()[level] * np.abs(force)
    return decoded.strand_friction(decoded.LEVELS[level], gamma)


def short_correlated(rng: np.random.Generator, size: int) -> np.ndarray:
    """A stationary AR(1) series of sd 1 with the correlation time above."""
    rho = float(np.exp(-1.0 / (RATE * CORRELATION_TIME)))
    steps = rng.standard_normal(size) * np.sqrt(1.0 - rho**2)
    steps[0] /= np.sqrt(1.0 - rho**2)
    out = np.empty(size)
    value = 0.0
    for i, step in enumerate(steps):
        value = rho * value + step
        out[i] = value
    return out


def loops_csv(muscle: str) -> str:
    """The text of loops_reconstructed.csv: one cycle (loading, then unloading) at each of five levels."""
    rng = np.random.default_rng(SEEDS[muscle])
    moduli = decoded.moduli(muscle)
    lines = [HEADER]
    start = 0.0
    for level, pressure in enumerate(decoded.LEVELS):
        end = decoded.first_root(float(pressure), moduli[level])
        one_way = np.arange(0.0, end * decoded.L0 / SPEED, 1.0 / RATE)
        back = np.concatenate([end * decoded.L0 - SPEED * one_way, SPEED * one_way])
        sign = np.repeat([1.0, -1.0], one_way.size)
        # The crosshead turns at L0: the unloading clock goes on where the loading clock stopped.
        clock = np.concatenate([one_way, one_way + one_way[-1] + 1.0 / RATE])
        gamma = np.round(back / MM, 4) * MM / decoded.L0
        true = decoded.force(pressure, gamma, moduli[level])
        noise = FORCE_WHITE * rng.standard_normal(back.size)
        noise += FORCE_CORRELATED * short_correlated(rng, back.size)
        force = true + sign * friction(muscle, level, gamma, true) + noise
        reading = pressure + PRESSURE_NOISE * rng.standard_normal(back.size)
        for t, p, g, f, s in zip(start + clock, reading, gamma, force, sign, strict=True):
            word = "loading" if s > 0 else "unloading"
            lines.append(
                f"{t:.2f},{pressure / KPA:.0f},{p / KPA:.2f},{g * decoded.L0 / MM:.4f},{f:.3f},1,{word}"
            )
        start += clock[-1] + PAUSE
    return "\n".join(lines) + "\n"


def rebuild(folder: Path) -> list[Path]:
    """Write the rebuilt files below ``folder`` and return their paths."""
    written = []
    for muscle in SEEDS:
        path = folder / f"{muscle.lower()}_reconstructed" / "loops_reconstructed.csv"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(loops_csv(muscle).encode())
        written.append(path)
    target = folder / "thesis_tables"
    target.mkdir(parents=True, exist_ok=True)
    for source in sorted((files("mpam_calib.thesis") / "tables").iterdir(), key=lambda p: p.name):
        if source.name.endswith(".csv"):
            path = target / source.name
            path.write_bytes(source.read_bytes())
            written.append(path)
    return written


if __name__ == "__main__":
    for path in rebuild(Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent):
        print(path)
