"""Data that are no measurements are told by the project's own marks, not by the user's words."""

from __future__ import annotations

from pathlib import Path

import pytest

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
