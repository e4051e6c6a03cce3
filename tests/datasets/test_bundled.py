"""The bundled data sets: rebuilt byte for byte, and what their READMEs say of them is so."""

from __future__ import annotations

import importlib.util
import re
import sys
import tomllib
from itertools import pairwise
from pathlib import Path
from types import ModuleType

import numpy as np
import pandas as pd
import pytest

from mpam_calib.thesis import decoded
from mpam_calib.thesis.tables import NAMES, half_unit, table

DATASETS = Path(__file__).parents[2] / "datasets"
RECONSTRUCTED = {"MPAM1": "mpam1_reconstructed", "MPAM2": "mpam2_reconstructed"}


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, DATASETS / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Dataclasses look their module up by name.
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


def loops(muscle: str) -> pd.DataFrame:
    return pd.read_csv(DATASETS / RECONSTRUCTED[muscle] / "loops_reconstructed.csv")


def test_the_script_writes_the_bundled_files_byte_for_byte(tmp_path: Path) -> None:
    written = script("rebuild").rebuild(tmp_path)
    assert len(written) == 2 + len(NAMES)
    for path in written:
        assert path.read_bytes() == (DATASETS / path.relative_to(tmp_path)).read_bytes(), path.name


def test_three_physical_corrections_predict_mpam1_between_levels_as_eight_moduli_do_not(
    tmp_path: Path,
) -> None:
    """Beside tensile moduli, against the thesis's joint linear law, with whose form they were computed."""
    all_data = script("diagnose_all")
    bare = all_data.read(all_data.bare("mpam1_reconstructed", tmp_path / "bare"))
    physical = ["coulomb_friction", "length_offset", "wall_pressure"]
    corrected = all_data.left_out(all_data.with_effects(bare, physical))
    moduli = all_data.left_out(all_data.read(DATASETS / "mpam1_reconstructed"))
    assert all_data.left_out(bare).between > 5.0
    assert corrected.between < 0.75 * moduli.between
    assert corrected.rmse < 1.1 * moduli.rmse
    assert corrected.coverage > 0.8


def test_tables_keep_their_misprints() -> None:
    assert table("4.3").text("50", "E_4 (Pa)") == table("4.3").text("50", "E_2 (Pa)") == "-1.0822e8"
    assert table("3.5").text("100", "Cost function (Case I)") == "39.70377"


@pytest.mark.parametrize("muscle", RECONSTRUCTED)
def test_readme_states_the_number_of_rows(muscle: str) -> None:
    rows = f"{len(loops(muscle)):,} rows"
    assert rows in (DATASETS / RECONSTRUCTED[muscle] / "README.md").read_text(encoding="utf-8")
    assert rows in (DATASETS / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("muscle", RECONSTRUCTED)
def test_protocol_is_the_thesis_s(muscle: str) -> None:
    data = loops(muscle)
    assert (np.diff(data.time_s) > 0).all()
    assert sorted(data.setpoint_kPa.unique()) == [50, 100, 150, 200, 250]
    for i, (_, level) in enumerate(data.groupby("setpoint_kPa")):
        gamma0 = decoded.first_root(float(decoded.LEVELS[i]), decoded.moduli(muscle)[i])
        assert level.displacement_mm.iloc[0] == pytest.approx(50 * gamma0, abs=1e-4)
        assert level.displacement_mm.min() < 50 / 60 / 100
        for _, stroke in level.groupby("branch", sort=False):
            # 50 mm/min at 100 Hz, but for the four decimals of the file
            assert np.abs(np.diff(stroke.displacement_mm)) == pytest.approx(50 / 60 / 100, abs=1.1e-4)
            assert np.diff(stroke.time_s) == pytest.approx(0.01, abs=1e-9)


@pytest.mark.parametrize("muscle", RECONSTRUCTED)
def test_force_is_the_decoded_curve_with_its_friction_and_noise(muscle: str) -> None:
    residuals = []
    for i, (_, level) in enumerate(loops(muscle).groupby("setpoint_kPa")):
        gamma = level.displacement_mm.to_numpy() / 50.0
        P = decoded.LEVELS[i]
        F = decoded.force(P, gamma, decoded.moduli(muscle)[i])
        K_f = decoded.coulomb_factors()[i]
        friction = K_f * np.abs(F) if muscle == "MPAM1" else decoded.strand_friction(P, gamma)
        sign = np.where(level.branch == "loading", 1.0, -1.0)
        residuals.append(level.force_N.to_numpy() - F - sign * friction)
    noise = np.concatenate(residuals)
    assert noise.std() == pytest.approx(0.25, rel=0.03)
    assert abs(noise.mean()) < 0.02
    # 0.15² / 0.25² of it is correlated; over 0.5 s nothing is left.
    lag = [np.corrcoef(noise[:-k], noise[k:])[0, 1] for k in (1, 50)]
    assert lag[0] == pytest.approx(0.36 * np.exp(-0.1), abs=0.04)
    assert abs(lag[1]) < 0.03


@pytest.mark.parametrize(
    ("muscle", "at_rest", "told"),
    [
        ("MPAM1", [0.33, 0.46, 0.57, 0.57, 0.57], ["0.3-0.7 N", "-0.4 to\n  -2.8 kN"]),
        (
            "MPAM2",
            [0.005, 0.655, 0.655, 0.655, 0.655],
            ["0.65 N (sd)", "0.005 N at 50 kPa", "-1.7 to\n  -3.3 kN", "4 N there and 20 N at L0"],
        ),
    ],
)
def test_what_printed_digits_and_strains_do_to_the_force(
    muscle: str, at_rest: list[float], told: list[str]
) -> None:
    cells, E = table(decoded.MUSCLES[muscle]).cells, decoded.moduli(muscle)
    half = np.array([[half_unit(text) for text in row] for row in cells])
    if muscle == "MPAM1":
        half[0, 3] = 625.0  # from Table 4.4's intercept
    lever = decoded.columns(np.asarray(0.0), E.shape[1])
    # Uniform within the last digit
    assert np.sqrt(np.sum((lever * half) ** 2, axis=1) / 3.0) == pytest.approx(at_rest, abs=0.006)
    free = [
        float(decoded.force(P, np.asarray(decoded.first_root(float(P), own)), own, "engineering"))
        for P, own in zip(decoded.LEVELS, E, strict=True)
    ]
    pushes = [F for F in free if F < 0]
    text = (DATASETS / RECONSTRUCTED[muscle] / "README.md").read_text(encoding="utf-8")
    assert all(words in text for words in told)
    assert f"{max(pushes) / 1e3:.1f} to\n  {min(pushes) / 1e3:.1f} kN" in text


@pytest.mark.parametrize("folder", sorted(p.parent.name for p in DATASETS.glob("*/specimen.toml")))
def test_every_specimen_names_files_that_are_there(folder: str) -> None:
    declared = tomllib.loads((DATASETS / folder / "specimen.toml").read_text(encoding="utf-8"))
    names = [n for v in declared["files"].values() for n in ([v] if isinstance(v, str) else v)]
    assert names and all((DATASETS / folder / name).is_file() for name in names)
    if folder.startswith("mpam"):
        assert "reconstructed" in declared["specimen"]["name"]
        assert "dead_band" in declared["simulation"]["effects"]


def test_every_folder_has_a_readme_with_source_and_licence() -> None:
    for folder in (p for p in DATASETS.iterdir() if p.is_dir() and not p.name.startswith("__")):
        text = (folder / "README.md").read_text(encoding="utf-8")
        assert "**Source.**" in text, folder.name
        if not folder.name.startswith("mpam"):
            assert "**Licence.**" in text, folder.name
        for name in re.findall(r"`(\w*LICENSE\w*(?:\.md)?)`", text):
            assert (folder / name).is_file(), (folder.name, name)


@pytest.mark.parametrize(
    ("folder", "rows", "censored"), [("festo_dmsp10", 85, 45), ("festo_dmsp20", 126, 66)]
)
def test_festo_maps_are_whole(folder: str, rows: int, censored: int) -> None:
    data = pd.read_csv(DATASETS / folder / "force_map.csv")
    assert len(data) == rows
    assert ((data.force_N == 0) == (data.censored == 1)).all()
    assert data.censored.sum() == censored


@pytest.mark.parametrize(
    ("folder", "ends", "off"),
    [
        ("festo_dmsp10", (5, 260, 360, 528.75, 650), {50: 5, 441.375: 444.375}),
        ("festo_dmsp20", (35, 135, 180, 250, 375, 675), {65: 60}),
    ],
)
def test_festo_levels_off_the_equal_steps_are_told(
    folder: str, ends: tuple[float, ...], off: dict[float, float]
) -> None:
    """Both grids are four equal steps from end to end; what is not on them stays as quoted."""
    levels = np.unique(pd.read_csv(DATASETS / folder / "force_map.csv").pressure_kPa)
    steps = np.unique(np.concatenate([np.linspace(a, b, 5) for a, b in pairwise(ends)]))
    found = {a: b for a, b in zip(levels, steps, strict=True) if abs(a - b) > 1e-3}
    assert found == off
    caveats = (DATASETS / folder / "README.md").read_text(encoding="utf-8").partition("**Caveats.**")[2]
    assert all(f"{a:g} kPa" in caveats and f"{b:g}" in caveats for a, b in off.items())


def test_the_cylinder_takes_the_higher_force_on_loading() -> None:
    folder = DATASETS / "cylinder_zillen"
    rows = 0
    for bar in range(1, 8):
        early, later = (pd.read_csv(folder / f"{kind}_{bar}bar.csv") for kind in ("loops", "later"))
        data = pd.concat([early, later])
        rows += len(data)
        assert (np.diff(data.time_s) > 0).all()
        assert (early.cycle.max(), later.cycle.min(), later.cycle.max()) == (4, 5, 10)
        force = data.groupby("branch").force_N.mean()
        assert force["loading"] > force["unloading"] + 10
    assert rows == 9307
    declared = tomllib.loads((folder / "specimen.toml").read_text(encoding="utf-8"))["files"]["loops"]
    used = sum(len(pd.read_csv(folder / name)) for name in declared)
    assert f"{used:,}" in (folder / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(("bad", "expected"), [(3, 0), (2, 1), (1, 1), (130, 130)])
def test_one_bad_data_set_does_not_stop_the_rest(
    bad: int, expected: int, capsys: pytest.CaptureFixture[str]
) -> None:
    module = script("calibrate_all")
    folders = module.data_sets([])
    asked = []

    def pretend(folder: Path, options: list[str]) -> object:
        asked.append(folder.name)
        return module.Ended(bad if folder == folders[1] else 0, 0.0, 0.0, False)

    module.calibrate, module.REPORTS = pretend, module.HERE.parent / "reports" / "nothing-here"
    assert module.main([]) == expected
    if expected != 130:
        assert asked == [folder.name for folder in folders]
        told = capsys.readouterr().out
        assert all(name[:8] in told for name in asked)
        assert ("Not converged" in told) == (bad == 3)
        assert ("could not be calibrated" in told) == (bad in (1, 2))
