"""Bands of the rubber's stress: what lies beyond the test is marked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.bands import stress_bands
from mpam_calib.specimen import read

STRAIN = np.linspace(0.0, 1.0, 41)


def bands(folder: Path, declared: str, tested: np.ndarray = STRAIN) -> tuple[np.ndarray, np.ndarray]:
    """Strains and marks of a test, up to a strain of one."""
    rows = "".join(f"{e:.4f},{4e4 * e:.1f}\n" for e in tested)
    (folder / "tensile.csv").write_text(f"strain,stress_Pa\n{rows}")
    (folder / "specimen.toml").write_text(
        '[specimen]\nname = "rubber"\n[files]\ntensile = "tensile.csv"\n[simulation]\norder = 2\n' + declared
    )
    model = build_model(draw_blueprint(read(folder)))
    u = np.zeros((4, len(model.names)))
    draws = Draws(u, model.values(u), np.zeros((4, sum(model.linear_sizes))), 1)
    table = stress_bands(model, draws, 0)
    return table["contraction"].to_numpy(), table["extrapolated"].to_numpy()


def test_strains_beyond_the_test_are_extrapolated(tmp_path: Path) -> None:
    strain, marked = bands(tmp_path, "[fit]\ntensile_strain = [0.0, 2.0]\n")
    assert strain.max() == pytest.approx(2.0)
    assert np.array_equal(marked, strain > 1.0 + 1e-6) and marked.any()


def test_strains_inside_the_test_are_not(tmp_path: Path) -> None:
    assert not bands(tmp_path, "[fit]\ntensile_strain = [0.1, 0.6]\n")[1].any()


def test_nor_are_only_those_beyond_it_but_those_before_it(tmp_path: Path) -> None:
    """The clamps had stretched it by three tenths before the first reading."""
    strain, marked = bands(tmp_path, "[fit]\ntensile_strain = [0.0, 1.0]\n", STRAIN[STRAIN >= 0.3])
    assert np.array_equal(marked, strain < 0.3 - 1e-6) and marked.any()
