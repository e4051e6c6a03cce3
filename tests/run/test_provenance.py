"""Data that are no measurements are told by the project's own marks, not by the user's words."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import pandas as pd
import pytest

from mpam_calib.report import designs
from mpam_calib.report.page import Page
from mpam_calib.run import diagnose, optimize, select
from mpam_calib.run.folder import run_digest
from mpam_calib.run.kept import Kept
from mpam_calib.run.provenance import PROVENANCE, provenance
from mpam_calib.specimen import read

from .command import Here
from .small import Specimen, loops_text

DATASETS = Path(__file__).parents[2] / "datasets"


def said(folder: Path) -> str:
    """The word of the sentence that is said of a specimen folder, "" for none."""
    sentence = provenance(read(folder))
    return next((word for word, known in PROVENANCE.items() if known == sentence), sentence)


@pytest.mark.parametrize(
    ("name", "header", "word"),
    [
        ("Synthetic latex 12", "", ""),
        ("A reconstructed braid, strain digitised", "# Muscle of synthetic rubber", ""),
        ("Muscle (synthetic)", "", "synthetic"),
        ("Muscle (reconstructed)", "", "reconstructed"),
        ("Muscle", "# DIGITISED from a printed figure.", "digitised"),
        ("Muscle (reconstructed)", "# SYNTHETIC: made by a simulation, not by a rig.", "synthetic"),
        ("Muscle", "# MEASURED, beside SYNTHETIC ones", ""),
    ],
)
def test_the_marks_are_those_that_the_project_writes(
    tmp_path: Path, name: str, header: str, word: str
) -> None:
    folder = Specimen(name=name).write(tmp_path / "muscle", loops=loops_text())
    toml = folder / "specimen.toml"
    toml.write_text(f"{header}\n{toml.read_text(encoding='utf-8')}", encoding="utf-8")
    assert said(folder) == word


@pytest.mark.parametrize(
    ("file", "word"),
    [("loops_reconstructed", "reconstructed"), ("loops_synthetic", "synthetic"), ("synthetic_latex", "")],
)
def test_files_are_marked_at_the_end_of_their_names(tmp_path: Path, file: str, word: str) -> None:
    folder = Specimen().write(tmp_path / "muscle", loops=loops_text())
    (folder / "loops.csv").rename(folder / f"{file}.csv")
    toml = folder / "specimen.toml"
    toml.write_text(toml.read_text(encoding="utf-8").replace("loops.csv", f"{file}.csv"), encoding="utf-8")
    assert said(folder) == word


MARK = "# RECONSTRUCTED from printed tables.\n"


def marked(toml: Path) -> None:
    """Put a mark on top of a declaration."""
    toml.write_text(MARK + toml.read_text(encoding="utf-8"), encoding="utf-8")


def test_a_mark_that_is_added_is_another_result(tmp_path: Path) -> None:
    """Although comments are left out of the specimen's own digest."""
    folder = Specimen().write(tmp_path / "muscle", loops=loops_text())
    before = read(folder)
    digest = run_digest(before, seed=0)
    toml = folder / "specimen.toml"
    toml.write_text("# A muscle.\n" + toml.read_text(encoding="utf-8"), encoding="utf-8")
    assert run_digest(read(folder), seed=0) == digest
    toml.write_text(MARK + toml.read_text(encoding="utf-8"), encoding="utf-8")
    assert read(folder).digest == before.digest
    assert run_digest(read(folder), seed=0) != digest


def test_the_mark_is_that_of_the_declaration_that_was_read(tmp_path: Path) -> None:
    folder = Specimen().write(tmp_path / "muscle", loops=loops_text())
    other = folder / "other.toml"
    shutil.copyfile(folder / "specimen.toml", other)
    marked(other)
    assert (said(other), said(folder)) == ("reconstructed", "")


@pytest.mark.parametrize("mark", [True, False])
@pytest.mark.parametrize("command", ["select", "diagnose"])
def test_the_pages_of_searches_say_so(
    command: str, mark: bool, tmp_path: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = Specimen().write(tmp_path / "muscle", loops=loops_text())
    if mark:
        marked(folder / "specimen.toml")
    module = {"select": select, "diagnose": diagnose}[command]
    found = SimpleNamespace(
        models=pd.DataFrame(), sensitivity=pd.DataFrame(), verdict=SimpleNamespace(word="")
    )
    page = {"select": "selection_page", "diagnose": "diagnosis_page"}[command]
    monkeypatch.setattr(module, command, lambda *data, **options: found)
    monkeypatch.setattr(module, page, lambda *content: Page("A", "B", [], []))
    monkeypatch.setattr(Kept, "finish", lambda self: None)
    if command == "diagnose":
        monkeypatch.setattr(module, "write_extended", lambda *content: None)
        monkeypatch.setattr(module, "describe", lambda *content: {})
        diagnose.diagnose_to_folder(folder, tmp_path / "run")
    else:
        select.select_to_folder(folder, tmp_path / "run")
    html = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert (PROVENANCE["reconstructed"] in html) == mark


def test_the_page_of_designs_says_what_the_run_says(run_copy: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs of older versions say nothing of it."""
    monkeypatch.setattr(designs, "designs_page", lambda view: Page("A", "B", [], []))
    for name in ("Optimiser", "table", "designs_table", "predict", "write_csv"):
        monkeypatch.setattr(optimize, name, MagicMock())
    file = run_copy / "run.json"
    state = json.loads(file.read_text(encoding="utf-8"))
    assert state["provenance"] == ""
    for words in (PROVENANCE["synthetic"], "", None):
        state["provenance"] = words
        if words is None:
            del state["provenance"]
        file.write_text(json.dumps(state), encoding="utf-8")
        _, page = optimize.optimize_to_folder(run_copy)
        assert ('class="notice"' in page.read_text(encoding="utf-8")) == bool(words)


def test_what_simulate_writes_and_what_is_bundled(muscle: Path, tmp_path: Path, here: Here) -> None:
    assert here("simulate", muscle, "-o", tmp_path / "made").code == 0
    assert said(tmp_path / "made") == "synthetic"
    assert {path.parent.name: said(path.parent) for path in DATASETS.glob("*/specimen.toml")} == {
        "cylinder_zillen": "",
        "ecoflex_tension": "",
        "festo_dmsp10": "",
        "festo_dmsp20": "",
        "mpam1_reconstructed": "reconstructed",
        "mpam2_reconstructed": "reconstructed",
    }
