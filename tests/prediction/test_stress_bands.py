"""Bands of the rubber's stress: what lies beyond the test is marked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.tensile import NOISE
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.bands import stress_bands
from mpam_calib.specimen import read

STRAIN = np.linspace(0.0, 1.0, 41)


def rubber(folder: Path, declared: str, tested: np.ndarray = STRAIN, count: int = 4) -> tuple[Model, Draws]:
    """Draws that are all one rubber, of a test up to a strain of one."""
    rows = "".join(f"{e:.4f},{4e4 * e:.1f}\n" for e in tested)
    (folder / "tensile.csv").write_text(f"strain,stress_Pa\n{rows}")
    (folder / "specimen.toml").write_text(
        '[specimen]\nname = "rubber"\n[files]\ntensile = "tensile.csv"\n[simulation]\norder = 2\n' + declared
    )
    model = build_model(draw_blueprint(read(folder)))
    u = np.zeros((count, len(model.names)))
    return model, Draws(u, model.values(u), np.zeros((count, sum(model.linear_sizes))), 1)


def bands(folder: Path, declared: str, tested: np.ndarray = STRAIN) -> tuple[np.ndarray, np.ndarray]:
    """Strains and marks."""
    table = stress_bands(*rubber(folder, declared, tested), 0)
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


def test_a_new_reading_scatters_by_the_noise_which_is_the_seed_s_own(tmp_path: Path) -> None:
    model, draws = rubber(tmp_path, "", count=2000)
    noise = float(draws.values[NOISE][0, 0])
    tables = [stress_bands(model, draws, seed) for seed in (0, 0, 1)]
    bare, seen = (tables[0][tables[0]["quantity"] == f"stress_Pa{s}"] for s in ("", "_observed"))
    assert bare["q95"].to_numpy() == pytest.approx(bare["q05"].to_numpy(), abs=1e-6 * noise)
    assert (seen["q95"] - seen["q05"]).mean() == pytest.approx(3.29 * noise, rel=0.02)
    assert tables[0].equals(tables[1])
    assert not tables[0]["q95"].equals(tables[2]["q95"])
