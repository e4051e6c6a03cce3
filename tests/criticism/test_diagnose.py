"""diagnose from a folder to a folder: what it writes, and that its repair is accepted."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest
from rig import case as rig_case
from rig import recipes, sets

from mpam_calib.criticism import diagnose as module
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.searching.candidates import Candidates, candidates
from mpam_calib.run.diagnose import diagnose_to_folder
from mpam_calib.specimen import read

CASE = "develop-separable-016"
"""Coulomb friction and a dead-band, hidden in a muscle with tensile moduli."""
SUSPECTS = {
    "coulomb_friction", "dead_band", "length_offset", "force_drift", "pressure_droop", "tip_shape",
    "rig_compliance", "strand_friction",
}  # fmt: skip
"""What is tried there, and in every fold; :mod:`criticism.test_sample` tries the whole catalogue."""


def suspects(problem: Problem) -> Candidates:
    every = candidates(problem)
    return replace(every, tested=tuple(e for e in every.tested if e in SUSPECTS))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, frozenset[str]]:
    folder = tmp_path_factory.mktemp("diagnose")
    one = recipes.build_case(next(r for r in sets.recipes("develop") if r.name == CASE))
    rig_case.write_case(one, folder / "specimen", folder / "truth.json")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "candidates", suspects)
        diagnose_to_folder(folder / "specimen", folder / "run")
    return folder / "run", frozenset(one.ids)


def test_the_hidden_causes_are_named(runs: tuple[Path, frozenset[str]]) -> None:
    content = json.loads((runs[0] / "diagnosis.json").read_text())
    assert content["verdict"] == "named"
    assert {cause["id"] for cause in content["causes"]} == runs[1]
    assert all(cause["probability"] >= 0.95 for cause in content["causes"])
    assert sum(cause["share_of_misfit"] for cause in content["causes"]) == pytest.approx(1.0, abs=0.1)


def test_further_causes_that_could_hide_beside_those_named_have_their_limits(
    runs: tuple[Path, frozenset[str]],
) -> None:
    content = json.loads((runs[0] / "diagnosis.json").read_text())
    limits = {limit["id"]: limit["parameters"] for limit in content["limits"]}
    assert not runs[1] & limits.keys()
    assert {"length_offset", "force_drift"} <= limits.keys()
    assert all(band["q05"] < band["q95"] for bands in limits.values() for band in bands.values())
    further = [set(a["ids"]) for a in content["alternatives"] if set(a["ids"]) > runs[1]]
    assert len(further) >= 5
    page = (runs[0] / "report.html").read_text()
    assert "Beside the causes named nothing was shown" in page


def test_the_same_again_is_kept(runs: tuple[Path, frozenset[str]]) -> None:
    specimen, files = runs[0].parent / "specimen", ("diagnosis.json", "report.html")
    before = [(runs[0] / name).stat().st_mtime_ns for name in files]
    assert diagnose_to_folder(specimen, runs[0]) is None
    assert [(runs[0] / name).stat().st_mtime_ns for name in files] == before


def test_the_gain_is_measured_on_levels_left_out(runs: tuple[Path, frozenset[str]]) -> None:
    gain = json.loads((runs[0] / "diagnosis.json").read_text())["gain"]
    assert gain["rmse_after_N"] < 0.5 * gain["rmse_before_N"]
    assert gain["elpd_gain"] > 3.0 * gain["elpd_gain_se"]
    assert gain["coverage90_after"] >= 0.8
    assert gain["folds_same_set"] >= gain["folds"] - 1
    # Kept in every fold, the causes predict at least about as well as what the folds find.
    assert gain["rmse_named_N"] < 1.1 * gain["rmse_after_N"]
    assert gain["coverage90_named"] >= 0.8


def test_nothing_hidden_is_adequate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one = recipes.build_case(next(r for r in sets.recipes("develop") if r.group == "null"))
    rig_case.write_case(one, tmp_path / "specimen", tmp_path / "truth.json")
    with (tmp_path / "specimen" / "specimen.toml").open("a") as toml:
        toml.write("\n[noise]\nrobust = true\n")
    monkeypatch.setattr(module, "candidates", suspects)
    diagnose_to_folder(tmp_path / "specimen", tmp_path / "run")
    content = json.loads((tmp_path / "run" / "diagnosis.json").read_bytes())
    assert (content["verdict"], content["causes"], content["gain"]) == ("adequate", [], None)
    # What could hide even so: sizes and names.
    limits = {limit["id"]: limit["parameters"] for limit in content["limits"]}
    assert {"length_offset", "strand_friction"} <= limits.keys()
    assert {"length_offset"} <= {a for s in content["alternatives"] for a in s["ids"]}
    assert all(band["q05"] < band["q95"] for bands in limits.values() for band in bands.values())
    page = (tmp_path / "run" / "report.html").read_text()
    assert "What could hide unseen" in page
    assert ">mm</td>" in page
    assert ">s</td>" not in page  # f_s is no time
    # What was declared and is not used is said on the page.
    assert "Heavy tails of the noise" in (tmp_path / "run" / "report.html").read_text()


def test_the_extended_specimen_is_accepted(runs: tuple[Path, frozenset[str]]) -> None:
    extended = read(runs[0] / "extended")
    assert set(extended.simulation.effect_ids) == runs[1]
    assert extended.loops is not None


def test_the_report_names_the_causes(runs: tuple[Path, frozenset[str]]) -> None:
    page = (runs[0] / "report.html").read_text()
    assert "Coulomb friction" in page and "dead-band" in page.lower()
    assert "http://" not in page.replace("http://www.w3.org", "")
