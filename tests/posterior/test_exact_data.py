"""Computed readings, without any noise: what they say is found, and nothing breaks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.model.priors import LogNormal
from mpam_calib.specimen import read

MODULI = np.array([4.0e4, 2.6e4])


def rubber(folder: Path, noise: float, rows: int = 60) -> Calibration:
    """A tensile test that is exactly the polynomial but for white noise (Pa)."""
    strain = np.linspace(0.02, 3.5, rows)
    stress = MODULI[0] * strain + MODULI[1] * strain**2
    stress = stress + noise * np.random.default_rng(0).standard_normal(rows)
    (folder / "specimen.toml").write_text(
        '[specimen]\nname = "Rubber"\n[files]\ntensile = "tensile.csv"\n[simulation]\norder = 2\n'
    )
    lines = "".join(f"{e:.10g},{s:.10g}\n" for e, s in zip(strain, stress, strict=True))
    (folder / "tensile.csv").write_text("strain,stress_Pa\n" + lines)
    return calibrate(read(folder))


@pytest.mark.parametrize("noise", [0.0, 30.0])
def test_a_tensile_test_without_noise(noise: float, tmp_path: Path) -> None:
    found = rubber(tmp_path, noise)
    assert found.converged
    rows = found.summary.set_index("parameter").loc[["E_1", "E_2"]]
    assert (np.abs(rows["mean"] - MODULI) < 4.0 * rows["sd"]).all()
    assert (rows["sd"] < (1e-3 if noise == 0.0 else 1e-2) * MODULI).all()


def test_a_prior_with_a_least_value() -> None:
    prior = LogNormal(2.0, 1.5, 1e-3)
    u = np.linspace(-4.0, 4.0, 9)
    assert prior.to_normal(prior.from_normal(u)) == pytest.approx(u, abs=1e-9)
    assert prior.from_normal(np.array([-40.0])) == pytest.approx(1e-3)
    assert prior.widened(2.0).least == prior.least
    assert np.isfinite(prior.to_normal(np.array([0.0, 1e-3]))).all()
