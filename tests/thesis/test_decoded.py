"""The decoded muscles against check values and against a plain scalar reading of the printed equations."""

from __future__ import annotations

import math

import numpy as np
import pytest

from mpam_calib.thesis import decoded
from mpam_calib.thesis.tables import NAMES, half_unit, table

# Force (N) at γ = 0, 0.05, 0.10, 0.20 and free contraction, from an independent evaluation.
CHECKS = {
    ("MPAM1", 50): (16.02, 12.14, 8.35, 1.64, 0.2264),
    ("MPAM1", 100): (34.98, 27.60, 20.66, 8.79, 0.2873),
    ("MPAM1", 150): (54.80, 44.12, 33.87, 16.33, 0.3125),
    ("MPAM1", 200): (73.25, 57.48, 44.05, 21.91, 0.3230),
    ("MPAM1", 250): (94.32, 74.49, 57.90, 30.51, 0.3334),
    ("MPAM2", 50): (20.40, 8.73, 4.27, -0.58, 0.1857),
    ("MPAM2", 100): (42.35, 29.72, 19.50, 2.41, 0.2138),
    ("MPAM2", 150): (74.18, 54.04, 38.58, 13.67, 0.2569),
    ("MPAM2", 200): (96.03, 72.91, 53.50, 21.51, 0.2752),
    ("MPAM2", 250): (117.58, 90.93, 67.85, 29.35, 0.2878),
}


def plain_force(P: float, gamma: float, E: list[float]) -> float:
    """Eq. 4.6 term by term with N, B and V_bl, stretches in place of the strains."""
    L0, R0, t, alpha0 = 0.05, 0.003, 0.0007, math.radians(72.0)
    L = L0 * (1.0 - gamma)
    B = L0 / math.sin(alpha0)
    R = (L0 * (R0**2 - (R0 - t) ** 2) + t * t * L) / (2.0 * t * L)
    alpha = math.asin(L / B)
    N = L / math.tan(alpha) / (2.0 * math.pi * R)
    V = math.pi * L * (R**2 - (R - t) ** 2)
    tan2 = math.tan(alpha) ** 2
    F = P * math.pi * (R * R * (2.0 * tan2 - 1.0) + (2.0 * R * t - t * t) - 2.0 * t * R * tan2)
    for k, modulus in enumerate(E, start=1):
        F += V / L * modulus * (L / L0) ** k
        F -= t * L * L / (2.0 * math.pi * N * N * R) * modulus * (R / R0) ** k
    return F


@pytest.mark.parametrize(("muscle", "level"), CHECKS)
def test_check_forces_and_free_contractions(muscle: str, level: int) -> None:
    i = list(decoded.LEVELS).index(level * 1e3)
    E = decoded.moduli(muscle)[i]
    *forces, root = CHECKS[muscle, level]
    for gamma, expected in zip((0.0, 0.05, 0.10, 0.20), forces, strict=True):
        assert float(decoded.force(decoded.LEVELS[i], np.asarray(gamma), E)) == pytest.approx(
            expected, abs=0.01
        )
    assert decoded.first_root(level * 1e3, E) == pytest.approx(root, abs=1e-4)


@pytest.mark.parametrize("muscle", decoded.MUSCLES)
def test_force_equals_the_plain_reading(muscle: str) -> None:
    for P, E in zip(decoded.LEVELS, decoded.moduli(muscle), strict=True):
        for gamma in (0.0, 0.03, 0.17, 0.3):
            own = float(decoded.force(P, np.asarray(gamma), E))
            assert own == pytest.approx(plain_force(float(P), gamma, list(E)), abs=1e-6)


def test_strains_as_printed_give_kilonewtons() -> None:
    F = decoded.force(np.asarray(2e5), np.asarray(0.3), decoded.moduli("MPAM1")[3], "engineering")
    assert float(F) < -1500.0


def test_modulus_recovered_from_the_printed_line() -> None:
    assert decoded.corrected_e4_50() == pytest.approx(-1.66755e7, abs=6e2)


def test_free_contraction_of_a_muscle_that_never_lets_go_is_nan() -> None:
    assert math.isnan(decoded.first_root(2e5, np.array([0.0]), limit=0.05))
    assert decoded.first_root(2e5, np.array([1e9])) == 0.0


def test_every_table_reads() -> None:
    assert len(NAMES) == 17
    for name in NAMES:
        printed = table(name)
        assert len(printed.cells) == len(printed.rows) > 0
        assert all(len(row) == len(printed.columns) for row in printed.cells)


def test_rounding_of_the_print() -> None:
    assert half_unit("-1.66e7") == pytest.approx(5e4)
    assert half_unit("0.0905") == pytest.approx(5e-5)
