"""Moduli by strain range: each range fitted by itself, and what its moduli make of a muscle."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from physics import plain

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.strain_range import MINIMUM, _quantities, strain_range_table
from mpam_calib.specimen import Specimen, read

STRAIN = np.linspace(0.0, 2.0, 201)
BREAK, SOFT, STIFF, NOISE = 0.5, 4e4, 9e4, 50.0
"""A rubber that is stiffer beyond a strain of 0.5 (Pa)."""


def rubber(
    folder: Path, high: float, low: float = 0.0, strain: np.ndarray = STRAIN
) -> tuple[Specimen, Model]:
    stress = SOFT * strain + (STIFF - SOFT) * np.maximum(strain - BREAK, 0.0)
    stress += NOISE * np.random.default_rng(0).standard_normal(len(strain))
    rows = "".join(f"{e:.4f},{s:.2f}\n" for e, s in zip(strain, stress, strict=True))
    (folder / "tensile.csv").write_text(f"strain,stress_Pa\n{rows}")
    (folder / "specimen.toml").write_text(
        '[specimen]\nname = "rubber"\n[files]\ntensile = "tensile.csv"\n[simulation]\norder = 1\n'
        f"[fit]\ntensile_strain = [{low}, {high}]\n"
    )
    specimen = read(folder)
    return specimen, build_model(draw_blueprint(specimen))


def table(folder: Path, high: float, *test: Any) -> tuple[pd.DataFrame, np.ndarray]:
    """The table, and the modulus (Pa) of the draws that it is given."""
    specimen, model = rubber(folder, high, *test)
    count, (p, q, r) = 400, model.linear_sizes
    u = np.zeros((count, len(model.names)))
    eta = np.random.default_rng(1).standard_normal((count, p + q + r))
    draws = Draws(u, model.values(u), eta, 1)
    assert model.moduli is not None
    return strain_range_table(specimen, model, draws, 0), model.moduli.coefficients(eta[:, :p], draws.values)


def test_each_range_has_the_modulus_of_its_own_readings(tmp_path: Path) -> None:
    found, own = table(tmp_path, 1.0)
    moduli = found[found["quantity"] == "E_1"].reset_index(drop=True)
    ranges = moduli[["strain_low", "strain_high"]].to_numpy().tolist()
    assert ranges == [[0.0, 1.0], [0.0, 0.5], [0.0, 0.25], [0.0, 2.0]]
    assert moduli["used"].tolist() == [True, False, False, False]
    # The declared range is the posterior itself.
    expected = [own.mean(), *np.quantile(own, [0.05, 0.95])]
    assert moduli.loc[0, ["mean", "q05", "q95"]].tolist() == pytest.approx(expected)
    # Below the break it is the soft modulus; the whole test lies between the two.
    assert moduli.loc[1:2, "mean"].tolist() == pytest.approx([SOFT, SOFT], rel=0.02)
    assert (moduli.loc[1:2, "q05"] < SOFT).all() and (moduli.loc[1:2, "q95"] > SOFT).all()
    assert 1.2 * SOFT < moduli.loc[3, "mean"] < STIFF


def test_halves_and_quarters_begin_where_the_range_does_and_the_whole_test_at_no_strain(
    tmp_path: Path,
) -> None:
    """A test piece that hung loose at first has strains below 0, which no bladder has."""
    found, _ = table(tmp_path, 1.0, 0.2, np.linspace(-0.1, 2.0, 211))
    ranges = found.loc[found["quantity"] == "E_1", ["strain_low", "strain_high"]].to_numpy()
    assert ranges == pytest.approx(np.array([[0.2, 1.0], [0.2, 0.6], [0.2, 0.4], [0.0, 2.0]]))


def test_a_range_of_few_readings_is_left_out(tmp_path: Path) -> None:
    step = STRAIN[1]
    found, _ = table(tmp_path, 4.0 * (MINIMUM - 2) * step)
    assert sorted(set(found["strain_high"])) == pytest.approx(
        [2.0 * (MINIMUM - 2) * step, 4.0 * (MINIMUM - 2) * step, 2.0]
    )


@pytest.mark.parametrize("convention", ["engineering", "stretch"])
def test_what_moduli_make_of_a_muscle_is_the_equations_written_out(convention: str) -> None:
    muscle = plain.Tube(0.05, 0.003, 0.0007, np.radians(72.0))
    moduli = np.array([[4e4, 1e4], [6e4, -2e4]])
    found = {name: (unit, values) for name, unit, values in _quantities(moduli, convention)}

    def force(gamma: float, E: np.ndarray) -> float:
        return plain.static(muscle, 200e3, gamma, E.tolist(), "inextensible_braid", convention)

    unit, values = found["force at 10 % of an MPAM1-shaped muscle, 200 kPa"]
    assert unit == "N" and values == pytest.approx([force(0.1, E) for E in moduli], rel=1e-9)
    unit, roots = found["its free contraction"]
    assert unit == "" and ((roots > 0.1) & (roots < 0.45)).all()
    for root, E in zip(roots, moduli, strict=True):
        assert force(root - 1e-4, E) > 0.0 > force(root + 1e-4, E)
    assert found["E_2"][1].tolist() == [1e4, -2e4]
