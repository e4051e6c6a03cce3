"""One finished run of a small muscle, and the way to run commands, for all tests of the RUN folder."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from .command import FAST, Here, run
from .small import Specimen, loops_text, tensile_text


@pytest.fixture
def here(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Here:
    return Here(capsys, monkeypatch)


@pytest.fixture(scope="session")
def muscle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A specimen folder with three levels of loops."""
    return Specimen().write(tmp_path_factory.mktemp("small") / "muscle", loops=loops_text())


@pytest.fixture(scope="session")
def muscle_run(muscle: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its finished RUN with seed 0; tests that write take a copy."""
    path = tmp_path_factory.mktemp("run") / "muscle_run"
    result = run("calibrate", muscle, "-o", path, *FAST)
    assert (result.code, result.unremarked) == (0, "")
    return path


@pytest.fixture
def run_copy(muscle_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(muscle_run, tmp_path / "copy"))


TENSILE = """\
[simulation]
moduli = "tensile"
order = 2
law = "constant"
"""


@pytest.fixture(scope="session")
def material(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A specimen folder with only a tensile test: quick to calibrate."""
    specimen = Specimen(name="Small material", geometry="", simulation=TENSILE)
    return specimen.write(tmp_path_factory.mktemp("small") / "material", tensile=tensile_text())


@pytest.fixture(scope="session")
def material_run(material: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("run") / "material_run"
    result = run("calibrate", material, "-o", path)
    assert (result.code, result.unremarked) == (0, "")
    return path
