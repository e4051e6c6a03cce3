"""The ledger's rules, and the command from end to end."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import arviz as az
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from typer.testing import CliRunner

from mpam_calib.cli.app import app
from mpam_calib.errors import InputError
from mpam_calib.thesis import decoded
from mpam_calib.thesis.errata import errata
from mpam_calib.thesis.figures import muscles
from mpam_calib.thesis.friction import best_strand_factor
from mpam_calib.thesis.ledger import COLUMNS, MISPRINT, NOT_REPRODUCIBLE, REPRODUCED, Ledger
from mpam_calib.thesis.page import compared
from mpam_calib.thesis.posterior import (
    MPAM1,
    MPAM1_STRAND,
    MPAM2,
    MuscleBands,
    missing,
    parameters,
    strand_factor,
    strand_factors,
    table_4_12,
)
from mpam_calib.thesis.reproduction import reproduce

DATASETS = Path(__file__).parents[2] / "datasets"


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reproduction")
    result = CliRunner().invoke(app, ["reproduce", "-o", str(folder)])
    assert result.exit_code == 0, result.output
    return folder


@pytest.fixture(scope="module")
def rows(out: Path) -> pd.DataFrame:
    return pd.read_csv(out / "reproduction.csv", keep_default_na=False, na_values={"computed": ""})


def cell(rows: pd.DataFrame, source: str, row: str, column: str) -> pd.Series:
    found = rows[(rows["source"] == source) & (rows["row"] == row) & (rows["column"] == column)]
    assert len(found) == 1, (source, row, column)
    return found.iloc[0]


def test_a_difference_must_be_explained() -> None:
    ledger = Ledger()
    assert ledger.check("T", "r", "c", "1.25", 1.2549).verdict == REPRODUCED
    with pytest.raises(ValueError, match=r"printed 1\.25, computed 1\.2561"):
        ledger.check("T", "r", "c", "1.25", 1.2561)
    assert ledger.check("T", "r", "c", "1.25", 1.2561, misprint="slip").verdict == MISPRINT
    assert ledger.check("T", "r", "c", "1.25", 1.2561, allow=0.002).verdict == REPRODUCED
    assert ledger.counts() == {REPRODUCED: 2, MISPRINT: 1, NOT_REPRODUCIBLE: 0, "unprinted": 0}


def test_an_explanation_does_not_make_a_misprint() -> None:
    assert Ledger().check("T", "r", "c", "7.0", 7.01, misprint="slip").verdict == REPRODUCED


def test_file_has_the_columns_and_verdicts_of_the_contract(rows: pd.DataFrame) -> None:
    assert tuple(rows.columns) == COLUMNS
    assert set(rows["verdict"]) == {REPRODUCED, MISPRINT, NOT_REPRODUCIBLE}
    assert (rows.loc[rows["verdict"] == MISPRINT, "note"] != "").all()
    assert (rows.loc[rows["verdict"] == REPRODUCED, "printed"] != "").all()
    assert rows.loc[rows["verdict"] != NOT_REPRODUCIBLE, "computed"].notna().all()
    assert not rows.duplicated(["source", "row", "column"]).any()


@pytest.mark.parametrize("mark", ["run.json", "kept.json"])
def test_results_of_other_commands_are_not_written_over(mark: str, tmp_path: Path) -> None:
    (tmp_path / mark).write_text("{}")
    result = CliRunner().invoke(app, ["reproduce", "-o", str(tmp_path)])
    assert isinstance(result.exception, InputError)
    assert str(result.exception).startswith(f"{tmp_path}: found a ")
    assert [p.name for p in tmp_path.iterdir()] == [mark]


def test_every_table_is_in(rows: pd.DataFrame) -> None:
    for name in ("3.2", "3.3", "3.4", "3.5", *(f"4.{i}" for i in range(1, 13))):
        assert (rows["source"] == f"Table {name}").any(), name


def test_optimum_to_five_decimals(rows: pd.DataFrame) -> None:
    exact = 2e5 * np.pi * 9e-6 * (2 * np.sqrt(0.6) * np.tan(np.radians(72)) ** 2 - 0.6)
    for method in ("GA+SQP", "GA+IP"):
        force = cell(rows, "Table 3.4", method, "Optimized Cost function")
        assert force["computed"] == pytest.approx(exact, abs=1e-5)
        assert cell(rows, "Table 3.4", method, "t (mm)")["computed"] == pytest.approx(0.676210, abs=1e-5)


def test_pressures_of_table_3_5(rows: pd.DataFrame) -> None:
    table = rows[rows["source"] == "Table 3.5"]
    assert len(table) == 7 * 5
    wrong = table[table["verdict"] == MISPRINT]
    assert set(wrong["row"]) == {"100"} and len(wrong) == 2
    assert wrong["note"].str.contains("swapped").all()
    notes = table[table["column"] == "Cost function (Case I)"].set_index("row")["note"]
    assert notes["200"].startswith("with n = 50") and notes["600"].startswith("with n = 100")


def test_case_one_ends_at_a_hundred_strands(rows: pd.DataFrame) -> None:
    n = cell(rows, "Table 3.2", "Case I", "n")
    assert (n["computed"], n["verdict"]) == (100.0, MISPRINT)
    assert cell(rows, "Table 3.2", "Case I", "R_br (mm)")["computed"] == pytest.approx(2.5)


def test_a_hundred_of_a_hundred_starts(rows: pd.DataFrame) -> None:
    for method in ("GA+SQP", "GA+IP"):
        row = cell(rows, "Text 3.4.2", f"100 random starts, {method}", "reached the optimum to 1e-5 N")
        assert row["computed"] == 100
        assert "evaluations" in row["note"]


def test_known_misprints_and_nothing_hidden(rows: pd.DataFrame) -> None:
    e4 = cell(rows, "Table 4.3", "50", "E_4 (Pa)")
    assert e4["verdict"] == MISPRINT and e4["computed"] == pytest.approx(-1.66755e7, abs=600)
    printed = rows[(rows["source"] == "Table 4.3") & (rows["printed"] != "")]
    others = printed[printed["row"] + printed["column"] != "50E_4 (Pa)"]
    assert len(others) == 19 and (others["verdict"] == REPRODUCED).all()
    for table, count in (("Table 4.5", 4), ("Table 4.8", 5)):
        printed = rows[(rows["source"] == table) & (rows["printed"] != "")]
        assert len(printed) == count and (printed["verdict"] == REPRODUCED).all()
    lost = [cell(rows, "Table 4.9", f"{P} kPa", "F(γ=0) of MPAM2 by the printed law (N)") for P in (100, 150)]
    assert lost[0]["computed"] > 400 and lost[1]["computed"] < -600


def test_numbers_of_the_text(rows: pd.DataFrame) -> None:
    expected = {
        ("Text 3.4.5", "α = 75° against 72°", "gain in blocked force (%)"): REPRODUCED,
        ("Text 3.4.3", "600 kPa", "blocked force (N)"): REPRODUCED,
        ("Text 4.7", "Present work (MPAM_2)", "blocked force over Festo's (%)"): REPRODUCED,
        ("Text 4.7", "Present work (MPAM_1)", "blocked force over Festo's (%)"): MISPRINT,
        ("Text 4.6.2.3", "theoretical friction", "mean R² (%)"): MISPRINT,
        ("Text 4.4", "300 kPa", "MPAM2 over MPAM1 (%)"): MISPRINT,
        # "Almost 238 N" above; here the text says 238 N.
        ("Text 4.7", "600 kPa", "blocked force (N)"): MISPRINT,
    }
    for place, verdict in expected.items():
        assert cell(rows, *place)["verdict"] == verdict, place
    # Statements without a number are errata, and a pressure is not held against a percentage.
    assert not rows.loc[rows["printed"] != "", "note"].str.contains("identical|impact").any()
    assert np.isnan(cell(rows, "Text 4.4", "MPAM2 at 20 kPa", "error (%)")["computed"])
    assert "31.8°" in cell(rows, "Text 1.3", "contractile or extensile", "braid angle (°)")["note"]
    slip = cell(rows, "Table 3.5", "100", "Cost function (Case I)")["note"]
    assert "39.793778 cut off" in slip


@pytest.mark.long
def test_same_seed_same_bytes_other_seed_same_verdicts(tmp_path: Path) -> None:
    files = []
    for i, seed in enumerate((0, 0, 7)):
        files.append(tmp_path / f"{i}.csv")
        reproduce(seed, starts=2).ledger.write(files[-1])
    assert files[0].read_bytes() == files[1].read_bytes() != files[2].read_bytes()
    ours, theirs = pd.read_csv(files[0]), pd.read_csv(files[2])
    assert (ours["verdict"] == theirs["verdict"]).all()


def test_every_erratum_has_a_proof(out: Path) -> None:
    ledger = reproduce(starts=2).ledger
    found = errata(ledger)
    assert len(found) > sum(row.verdict == MISPRINT for row in ledger.rows)
    assert all(e.proof.strip(". ") and e.printed for e in found)
    assert "Errata" in (out / "report.html").read_text(encoding="utf-8")


def test_material_is_the_bundled_curve() -> None:
    from importlib.resources import files

    own = (files("mpam_calib.thesis") / "material" / "ecoflex_00_50.csv").read_bytes()
    assert own == (DATASETS / "ecoflex_tension" / "tensile.csv").read_bytes()


SIZES = {"L0_mm": 50.0, "R0_mm": 3.0, "t0_mm": 0.7, "alpha0_deg": 72.0}


def write_record(
    folder: Path,
    geometry: dict[str, float] | None = SIZES,
    material: str = "",
    levels: tuple[float, ...] = (1e5,),
) -> None:
    """What a run says of itself, as far as the reproduction asks."""
    blueprint = {"geometry": geometry, "levels": levels}
    content = {"blueprint": blueprint, "specimen": {"name": "M", "bladder_material": material}}
    (folder / "run.json").write_text(json.dumps(content))


def run_folder(folder: Path) -> Path:
    """A RUN folder as calibrate and predict write it, small."""
    write_record(folder)
    q = "quantity,pressure_kPa,contraction,branch,mean,q05,q25,q50,q75,q95,extrapolated"
    bands = [
        q,
        "blocked_force_N,250,0,,94,90,92,94,96,98,False",
        "free_contraction,250,,,0.33,0.32,0.33,0.33,0.33,0.34,False",
    ]
    (folder / "bands.csv").write_text("\n".join(bands) + "\n")
    (folder / "predictions.csv").write_text(f"{q}\nblocked_force_N,300,0,,113,105,110,113,116,121,True\n")
    head = "parameter,unit,mean,sd,q05,q50,q95,prior_sd,rhat,ess_bulk,ess_tail"
    values = "0.07,0.01,0.05,0.07,0.09,0.2,1.0,900,900"
    (folder / "summary.csv").write_text(
        f"{head}\nK_f@100,,{values}\na_1,Pa/kPa,{values}\nnoise_sd_N,N,{values}\n"
    )
    return folder


def test_bands_join_tables(tmp_path: Path) -> None:
    bands = {"MPAM1": MuscleBands.read("MPAM1", run_folder(tmp_path))}
    frame = table_4_12(bands)
    assert list(frame["pressure_kPa"]) == [300.0, 250.0, 250.0]
    assert list(frame["printed"]) == ["120", "120", "33.2"]
    assert frame["q50"].iloc[2] == pytest.approx(33.0)
    assert list(frame["extrapolated"]) == [True, False, False]
    assert list(parameters(bands)["printed"]) == ["0.0702", "8.521e5"]


@pytest.mark.parametrize("converged", [True, False])
def test_bands_of_a_run_that_did_not_converge_are_marked(converged: bool, tmp_path: Path) -> None:
    record = run_folder(tmp_path) / "run.json"
    record.write_text(json.dumps(json.loads(record.read_text()) | {"converged": converged}))
    own = MuscleBands.read(MPAM1, tmp_path)
    assert own.converged == converged
    told = [block for block in compared({MPAM1: own}).blocks if "did not converge" in str(block)]
    assert bool(told) != converged


def test_a_folder_that_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="expected the RUN folder of a finished calibrate"):
        MuscleBands.read("MPAM1", tmp_path)


def test_a_run_without_strand_friction_is_refused_where_it_is_wanted(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="found no f_s"):
        MuscleBands.read(MPAM1_STRAND, run_folder(tmp_path))


@pytest.mark.parametrize(
    ("record", "found"),
    [
        (
            {"geometry": {**SIZES, "L0_mm": 120.0}},
            "found another muscle, L0_mm = 120, expected MPAM1's L0_mm = 50",
        ),
        ({"geometry": {**SIZES, "alpha0_deg": 61.4}}, "found another muscle, alpha0_deg = 61.4"),
        ({"geometry": None, "levels": ()}, "found a run of a material, expected one of the muscle MPAM1"),
        ({"levels": ()}, "found a run of a material"),
        ({"material": "PDMS + Ecoflex 00-30 (1:10)"}, "found a bladder of PDMS"),
    ],
)
def test_a_run_of_something_else_is_refused(record: dict[str, Any], found: str, tmp_path: Path) -> None:
    run = run_folder(tmp_path)
    MuscleBands.read(MPAM1, run)
    write_record(run, **record)
    with pytest.raises(InputError, match=f"run.json: {re.escape(found)}"):
        MuscleBands.read(MPAM1, run)


@pytest.mark.parametrize("content", [None, "", "[]", '{"blueprint": {}}'])
def test_a_run_that_does_not_say_what_it_is_of_is_refused(content: str | None, tmp_path: Path) -> None:
    record = run_folder(tmp_path) / "run.json"
    record.unlink()
    if content is not None:
        record.write_text(content)
    with pytest.raises(InputError, match=r"run\.json: found no readable record"):
        MuscleBands.read(MPAM1, tmp_path)


def test_the_command_refuses_another_muscle_s_run_and_writes_nothing(tmp_path: Path) -> None:
    for option in ("--mpam1", "--mpam2", "--mpam1-strand"):
        run = strand_run(tmp_path / option)
        write_record(run, {**SIZES, "R0_mm": 5.0})
        out = tmp_path / "out"
        result = CliRunner().invoke(app, ["reproduce", "-o", str(out), option, str(run)])
        assert isinstance(result.exception, InputError) and "R0_mm = 5" in str(result.exception)
        assert not out.exists()


def strand_run(folder: Path, P_kPa: float = 99.6) -> Path:
    """A RUN folder with strand friction: one curve, draws of f_s."""
    folder.mkdir()
    write_record(folder)
    rng = np.random.default_rng(2)
    draws = rng.normal(0.3, 0.02, (2, 200))
    az.from_dict(posterior={"f_s": draws}).to_netcdf(str(folder / "posterior.nc"), engine="h5netcdf")
    head = "quantity,pressure_kPa,contraction,branch,mean,q05,q25,q50,q75,q95,extrapolated"
    lines = [
        f"force_N,{P_kPa},{g},{branch},{30 + 9 * s},{28 + 9 * s},29,30,31,{32 + 9 * s},False"
        for branch, s in (("loading", 1), ("mean", 0), ("unloading", -1))
        for g in (0.005, 0.0)
    ]
    (folder / "bands.csv").write_text("\n".join([head, *lines]) + "\n")
    head = "parameter,unit,mean,sd,q05,q50,q95,prior_sd,rhat,ess_bulk,ess_tail"
    (folder / "summary.csv").write_text(f"{head}\nf_s,,0.3,0.02,0.27,0.3,0.33,0.3,1.0,400,400\n")
    return folder


def test_curve_of_the_nearest_level(tmp_path: Path) -> None:
    own = MuscleBands.read(MPAM2, strand_run(tmp_path / "run"))
    assert not own.coulomb
    curve = own.curve(100.0, "loading")
    assert list(curve["contraction"]) == [0.0, 0.005] and list(curve["q05"]) == [37, 37]
    assert own.curve(150.0, "loading").empty


def test_bands_reach_the_figures_of_the_loops(tmp_path: Path) -> None:
    bands = {name: MuscleBands.read(name, strand_run(tmp_path / name)) for name in (MPAM2, MPAM1_STRAND)}
    # Fig. 4.14 (MPAM1) has no run, Fig. 4.18 has; of the loops only the two with strand friction.
    assert [len(ax.collections) for ax in muscles.average_curves({}).axes] == [0, 0]
    assert [filled(ax) for ax in muscles.average_curves(bands).axes] == [0, 1]
    assert [filled(ax) for ax in muscles.loops(bands).axes] == [2, 0, 2]
    # A run with the other friction is not put under Fig. 4.22.
    other = {MPAM1: MuscleBands.read(MPAM1, strand_run(tmp_path / "other"))}
    assert [filled(ax) for ax in muscles.loops(other).axes] == [0, 0, 0]


def filled(ax: Axes) -> int:
    """How many bands with an extent a panel shows."""
    return sum(len(path.vertices) > 4 for item in ax.collections for path in item.get_paths())


def test_f_s_by_posterior_beside_least_squares(tmp_path: Path) -> None:
    bands = {name: MuscleBands.read(name, strand_run(tmp_path / name)) for name in (MPAM2, MPAM1_STRAND)}
    table = strand_factors(bands).set_index("run")
    assert table["posterior mean"].to_numpy() == pytest.approx(0.3, abs=0.01)
    assert table.loc[MPAM1_STRAND, "least squares"] == pytest.approx(best_strand_factor(3, 0.98, False))
    assert np.isnan(table.loc[MPAM2, "least squares"])
    # Three runs, three commands; what was given is not asked for.
    assert list(missing({})["run"]) == [MPAM1, MPAM2, MPAM1_STRAND]
    assert list(missing(bands)["run"]) == [MPAM1]
    assert table_4_12({MPAM1_STRAND: bands[MPAM1_STRAND]}).empty


def test_page_says_what_is_missing_and_how_to_add_it(out: Path) -> None:
    text = (out / "report.html").read_text(encoding="utf-8")
    assert "Posteriors: none given" in text
    for option in ("--mpam1 RUN1", "--mpam2 RUN2", "--mpam1-strand RUN3"):
        assert option in text
    # The declared braid is chapter 3's; f_s of chapter 4 belongs to another modulus.
    assert f"E_br_GPa = {decoded.E_BR / 1e9:.1f}" in text


def test_draws_of_f_s_beside_the_print() -> None:
    said = strand_factor(np.random.default_rng(1).normal(0.4, 0.05, 4000))
    assert said["q05"] < 0.4 < said["q95"] and said["below_printed"] == 0.0
    assert said["matched_low"] == pytest.approx(0.447, abs=0.001)
    assert decoded.F_S == 0.15
