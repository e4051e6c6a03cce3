"""The decoded muscles against check values and against a plain scalar reading of the printed equations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from physics.test_check_values import VALUES

from mpam_calib.thesis import decoded
from mpam_calib.thesis.tables import NAMES, half_unit, table


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


@pytest.mark.parametrize(("muscle", "level"), VALUES)
def test_check_forces_and_free_contractions(muscle: str, level: int) -> None:
    i = list(decoded.LEVELS).index(level * 1e3)
    E = decoded.moduli(muscle)[i]
    *forces, root = VALUES[muscle, level]
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
