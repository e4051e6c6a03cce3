"""``mpam-calib optimize``: its table and report, the same bytes, what it refuses."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mpam_calib.design import robust
from mpam_calib.design.robust import COLUMNS, Optimiser, designs_table
from mpam_calib.posterior.stored import load_run
from mpam_calib.report.designs import DesignsView, designs_page
from mpam_calib.run.optimize import optimize_to_folder

from .command import Here

PRESSURES = [50.0, 100.0, 200.0, 300.0, 400.0, 500.0, 600.0]


@pytest.fixture(scope="module", autouse=True)
def fewer_draws() -> Iterator[None]:
    """Enough for the files: designs and bands are tested in tests/design."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(robust, "SEARCHED", 50)
        patch.setattr(robust, "BANDED", 200)
        yield


@pytest.fixture(scope="module")
def optimised(muscle_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the small muscle's run with its designs."""
    path = Path(shutil.copytree(muscle_run, tmp_path_factory.mktemp("optimised") / "run"))
    optimize_to_folder(path, 0)
    return path


@pytest.fixture(scope="module")
def designs(optimised: Path) -> pd.DataFrame:
    return pd.read_csv(optimised / "designs.csv")


def test_table_is_that_of_the_contract(designs: pd.DataFrame) -> None:
    assert list(designs.columns) == COLUMNS
    assert ",".join(COLUMNS) == (
        "case,pressure_kPa,method,R_mm,t_mm,alpha_deg,R_br_mm,n,"
        "blocked_force_N,q05,q50,q95,free_contraction,fc_q05,fc_q95"
    )
    for case in ("I", "II"):
        for method in ("posterior_mean", "q05"):
            rows = designs[(designs["case"] == case) & (designs["method"] == method)]
            assert list(rows["pressure_kPa"]) == PRESSURES
    assert len(designs) == 4 * len(PRESSURES)


def test_designs_keep_table_3_1_and_bands_are_in_order(designs: pd.DataFrame) -> None:
    assert designs["R_mm"].between(0.45, 3.0 + 1e-6).all()
    assert designs["t_mm"].between(0.16, 1.5).all()
    assert designs["alpha_deg"].between(36.0, 72.0 + 1e-6).all()
    ratio = designs["t_mm"] / designs["R_mm"]
    assert (ratio * (2.0 - ratio) >= 0.4 - 1e-6).all()
    one = designs["case"] == "I"
    assert designs.loc[one, "n"].between(30, 100).all()
    assert (designs.loc[one, "n"] == designs.loc[one, "n"].round()).all()
    assert designs.loc[one, "R_br_mm"].between(0.005, 2.5 + 1e-6).all()
    assert designs.loc[~one, ["R_br_mm", "n"]].isna().all(axis=None)
    assert ((designs["q05"] <= designs["q50"]) & (designs["q50"] <= designs["q95"])).all()
    assert (designs["fc_q05"] <= designs["free_contraction"]).all()
    assert (designs["free_contraction"] <= designs["fc_q95"]).all()


def test_moduli_in_engineering_strain_leave_the_blocked_force_alone(
    designs: pd.DataFrame, optimised: Path
) -> None:
    # No dead-band, no tolerance declared: Eq. 3.16 and the remainder are all there is.
    row = designs[(designs["case"] == "II") & (designs["pressure_kPa"] == 200.0)].iloc[0]
    remainder = float(load_run(optimised).draws.values["remainder_sd_N"].mean())
    assert row["blocked_force_N"] == pytest.approx(79.58756, abs=3.0 * remainder + 0.1)
    assert row["t_mm"] == pytest.approx(3.0 * (1.0 - np.sqrt(0.6)), abs=1e-4)


def test_each_method_is_best_at_its_own_aim(designs: pd.DataFrame) -> None:
    wide = designs.pivot_table(
        index=["case", "pressure_kPa"], columns="method", values=["q05", "blocked_force_N"]
    )
    assert (wide["q05", "q05"] >= wide["q05", "posterior_mean"] - 1e-9).all()
    assert (wide["blocked_force_N", "posterior_mean"] >= wide["blocked_force_N", "q05"] - 1e-9).all()


def test_report_says_first_that_it_extrapolates(optimised: Path) -> None:
    text = (optimised / "designs.html").read_text(encoding="utf-8")
    body = text[text.index("<main") if "<main" in text else 0 :]
    assert body.index("Extrapolated.") < body.index("Within the thesis's bounds (R 0.45–3 mm")
    assert "Moduli fitted at one R and t need not hold at another" in text
    assert "50, 300, 400, 500, 600 kPa lie outside the recorded pressures" in text
    assert "declares no sd of the braid angle" in text
    assert "Strands that fit" in text and "in each direction fit round the muscle" in text


def test_same_seed_same_bytes(optimised: Path, run_copy: Path, here: Here) -> None:
    result = here("optimize", run_copy)
    assert (result.code, result.err) == (0, "")
    for name in ("designs.csv", "designs.html"):
        assert (run_copy / name).read_bytes() == (optimised / name).read_bytes(), name
        assert str(run_copy / name) in result.out.splitlines()


def test_a_material_has_no_designs(material_run: Path, here: Here) -> None:
    result = here("optimize", material_run)
    assert result.code == 2
    assert result.complaint == (
        f"error: {material_run / 'run.json'}: found a material, not a muscle, expected a run of a muscle"
    )
    assert not (material_run / "designs.csv").exists()


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path, here: Here) -> None:
    result = here("optimize", tmp_path)
    assert result.code == 2 and "no finished run" in result.complaint
    assert list(tmp_path.iterdir()) == []


def test_an_unconverged_run_is_told(run_copy: Path) -> None:
    stored = load_run(run_copy)
    optimiser = Optimiser(stored.model, stored.draws.thin(50))
    found = optimiser.at(200e3)
    view = DesignsView(
        name="small",
        converged=False,
        blueprint=stored.model.blueprint,
        designs=found,
        table=designs_table(found),
        packed=[optimiser.packed(200e3, (0.13e-3,))],
        radii=(0.13e-3,),
        printed={"I": np.array([79.58109]), "II": np.array([79.58755])},
        draws=(50, 50),
    )
    assert "did not converge" in designs_page(view).render()
    assert json.loads((run_copy / "run.json").read_text())["converged"] is True
    assert len(view.table) == 4
