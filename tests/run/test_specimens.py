"""Specimens of every kind through the whole command: maps, materials, declared moduli, uncertain geometry."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pandas as pd
import pytest

from mpam_calib.specimen import read

from .command import FAST, RESULTS, Here, contents
from .small import (
    LEVELS,
    MATERIAL,
    MODULI,
    SIMULATION,
    Specimen,
    free_contraction,
    loops_text,
    map_text,
    static_force,
    stress_Pa,
    tensile_text,
)

STATIC = SIMULATION.replace('friction = "coulomb"', 'friction = "none"')
DECLARED = STATIC.replace('"loops"', '"tensile"\nE_Pa = [2.4e5, 6.0e4]\nE_rel_sd = 0.1').replace(
    "linear", "constant"
)
BARE = (*FAST, "--no-remainder")
"""Without a remainder the bands hold the parameters alone."""


def bands_of(run: Path) -> pd.DataFrame:
    return pd.read_csv(run / "bands.csv")


def blocked(run: Path) -> pd.DataFrame:
    table = bands_of(run)
    return table[table["quantity"] == "blocked_force_N"].set_index("pressure_kPa")


def test_a_force_map_alone_is_calibrated(tmp_path: Path, here: Here) -> None:
    specimen = Specimen(name="Map", simulation=STATIC).write(tmp_path / "map", force_map=map_text())
    run = tmp_path / "run"
    assert here("calibrate", specimen, "-o", run, *BARE).code == 0
    assert set(RESULTS) == set(contents(run))
    summary = pd.read_csv(run / "summary.csv", index_col="parameter")
    assert "K_f" not in summary.index
    for k, (a, b) in enumerate(MODULI, start=1):
        for name, value in ((f"a_{k}", a), (f"b_{k}", b)):
            assert abs(summary.loc[name, "mean"] - value) < 4.0 * summary.loc[name, "sd"]
    for level in LEVELS:
        found = blocked(run).loc[level]
        truth = static_force(pd.Series([level]).to_numpy(), pd.Series([0.0]).to_numpy())[0]
        assert abs(found["mean"] - truth) < 0.2
    free = bands_of(run).query("quantity == 'free_contraction'").set_index("pressure_kPa")["mean"]
    assert free[LEVELS[-1]] == pytest.approx(free_contraction(LEVELS[-1]), abs=2e-3)


@pytest.fixture(scope="module")
def declared(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a force map of one low level, and where its runs go."""
    return tmp_path_factory.mktemp("declared")


def predicted_width(folder: Path, name: str, tables: str, here: Here) -> float:
    """Width of the predicted blocked force at 200 kPa, where nothing was measured; declared moduli.

    Without a remainder, which says more there than any declared sd.
    """
    run = folder / f"{name}_run"
    if not run.exists():
        specimen = Specimen(simulation=DECLARED, tables=tables)
        specimen.write(folder / name, force_map=map_text(levels=(100.0,)))
        assert here("calibrate", folder / name, "-o", run, *BARE).code == 0
        assert here("predict", run, "--pressure", "200").code == 0
    row = pd.read_csv(run / "predictions.csv").set_index("quantity").loc["blocked_force_N"]
    return float(row["q95"] - row["q05"])


@pytest.mark.parametrize(
    ("tables", "name"),
    [
        ("[geometry.sd]\nalpha0_deg = 1.0\n", "alpha0_deg"),
        ("[sensors]\npressure_bias_sd_kPa = 5.0\n", "pressure_bias_kPa"),
    ],
    ids=["geometry", "gauge"],
)
def test_declared_uncertainty_is_sampled_and_widens_the_bands(
    tables: str, name: str, declared: Path, here: Here
) -> None:
    known = predicted_width(declared, "known", "", here)
    assert predicted_width(declared, name, tables, here) > 1.05 * known
    for run in ("known", name):
        listed = set(pd.read_csv(declared / f"{run}_run" / "summary.csv")["parameter"])
        assert (name in listed) == (run == name)


def test_declared_moduli_keep_their_ratio(declared: Path, here: Here) -> None:
    import arviz as az

    predicted_width(declared, "known", "", here)
    posterior = az.from_netcdf(str(declared / "known_run" / "posterior.nc")).posterior
    ratio = (posterior["E_1"] / posterior["E_2"]).to_numpy()
    assert abs(ratio / 4.0 - 1.0).max() < 1e-9


def test_a_material_has_bands_on_stress_and_no_muscle(material_run: Path, here: Here) -> None:
    table = bands_of(material_run)
    assert set(table["quantity"]) == {"stress_Pa", "stress_Pa_observed"}
    stress = table[table["quantity"] == "stress_Pa"]
    strain = stress["contraction"].to_numpy()
    assert strain[0] == 0.0 and strain[-1] == 1.0
    assert abs(stress["mean"] - stress_Pa(strain)).max() < 60.0
    summary = pd.read_csv(material_run / "summary.csv", index_col="parameter")
    for name, (_, value) in zip(("E_1", "E_2"), MATERIAL, strict=True):
        assert abs(summary.loc[name, "mean"] - value) < 4.0 * summary.loc[name, "sd"]
    page = (material_run / "report.html").read_text().lower()
    assert "strain" in page and "mpam1-shaped muscle" in page
    refused = here("predict", material_run, "--pressure", "100")
    assert refused.code == 2
    assert refused.complaint.startswith("error: --pressure: found ")


def test_a_declared_strain_range_bounds_the_bands(material: Path, tmp_path: Path, here: Here) -> None:
    own = Path(shutil.copytree(material, tmp_path / "own"))
    with (own / "specimen.toml").open("a") as file:
        file.write("\n[fit]\ntensile_strain = [0.1, 0.6]\n")
    assert here("calibrate", own, "-o", tmp_path / "run").code == 0
    strain = bands_of(tmp_path / "run")["contraction"]
    assert (strain.min(), strain.max()) == (0.1, 0.6)


def test_a_materials_run_gives_a_muscle_its_moduli(
    material: Path, material_run: Path, tmp_path: Path, here: Here
) -> None:
    simulation = SIMULATION.replace('"loops"', '"run:../material_run"').replace("linear", "constant")
    loops = loops_text(rows=60, moduli=MATERIAL)
    folder = Specimen(simulation=simulation).write(tmp_path / "muscle", loops=loops)
    shutil.copytree(material_run, tmp_path / "material_run")
    run = tmp_path / "run"
    assert here("calibrate", folder, "-o", run, *BARE).code == 0
    tested, found = (pd.read_csv(path / "summary.csv", index_col="parameter") for path in (material_run, run))
    for name, (_, value) in zip(("E_1", "E_2"), MATERIAL, strict=True):
        assert found.loc[name, "prior_sd"] == pytest.approx(tested.loc[name, "sd"], rel=0.1)
        assert found.loc[name, "sd"] < 1.05 * tested.loc[name, "sd"]
        assert abs(found.loc[name, "mean"] - value) < 4.0 * found.loc[name, "sd"]
    assert len(json.loads((run / "run.json").read_text())["blueprint"]["material"]["mean"]) == 2
    report = (run / "report.html").read_text()
    assert "tensile test between strains 0 and 1;" in report and "did not converge" not in report

    # The run knows its own order and strain; the muscle may say the same or nothing.
    declaration = folder / "specimen.toml"
    told = declaration.read_text()
    declaration.write_text(told.replace("order = 2\n", ""))
    silent = read(folder).simulation
    assert (silent.order, silent.strain, silent.law) == (2, "engineering", "constant")
    for old, new in (("order = 2", "order = 3"), ('strain = "engineering"', 'strain = "stretch"')):
        changed = told.replace(old, new) if old in told else f"{told}{new}\n"
        declaration.write_text(changed)
        refused = here("check", folder)
        assert refused.code == 2
        assert f"simulation.{new.split()[0]}: found" in refused.complaint
        assert 'as in "run:../material_run"' in refused.complaint
    declaration.write_text(told)

    # Another test of the material makes the muscle's run another one.
    assert "kept" in here("calibrate", folder, "-o", run, *BARE).out
    assert here("calibrate", material, "-o", tmp_path / "material_run", "--seed", 3).code == 0
    again = here("calibrate", folder, "-o", run, *BARE)
    assert again.code == 0 and "kept" not in again.out


@pytest.mark.parametrize("unused", [{}, {"tensile": tensile_text()}], ids=["alone", "beside a test"])
def test_moduli_of_another_muscle_that_has_not_converged_are_told(
    unused: dict[str, str], tmp_path: Path, here: Here
) -> None:
    constant = SIMULATION.replace("linear", "constant")
    loops = loops_text(rows=60, moduli=MATERIAL)
    first = Specimen(simulation=constant).write(tmp_path / "first", loops=loops, **unused)
    simulation = constant.replace('"loops"', '"run:../run"')
    second = Specimen(simulation=simulation).write(tmp_path / "second", loops=loops)
    run, after = tmp_path / "run", tmp_path / "after"
    assert here("calibrate", first, "-o", run, *BARE, "--max-steps", 3).code == 3
    result = here("predict", run, "--pressure", 120)
    assert result.code == 0
    assert result.complaint.startswith(f"warning: {run} did not converge")
    assert here("calibrate", second, "-o", after, *BARE, "--max-steps", 3).code == 3
    report = (after / "report.html").read_text()
    assert "The moduli come from another muscle" in report and "tensile test" not in report
    told, _ = report.split("<nav", 1)  # on the first screen, not among the remarks on the data
    assert "The run that the moduli come from did not converge" in told


def test_without_data_there_is_nothing_to_calibrate(tmp_path: Path, here: Here) -> None:
    folder = Specimen().write(tmp_path / "bare")
    result = here("calibrate", folder, "-o", tmp_path / "run")
    assert result.code == 2
    assert "no data files" in result.complaint
    assert not (tmp_path / "run").exists()
