"""Whose page a command is about to replace is told before that is done, and nothing where it refuses."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import numpy as np
import pytest

from mpam_calib.posterior.chains.sampling import Listener, Progress
from mpam_calib.run.kept import Kept
from mpam_calib.run.replaced import page_owner, tell_replaced

from .command import Here, refuse
from .small import Specimen, csv_text


def finish(folder: Path, command: str, result: str) -> None:
    """Leave what a diagnosis or selection leaves."""
    files = (result, "report.html")
    for name in files:
        (folder / name).write_text(command)
    Kept(folder, command, "a digest", files).finish()


def test_a_page_is_the_last_command_s(tmp_path: Path) -> None:
    assert page_owner(tmp_path) is None
    (tmp_path / "run.json").write_text("{}")
    assert page_owner(tmp_path) is None
    (tmp_path / "report.html").write_text("a calibration's")
    assert page_owner(tmp_path) == "calibration"
    finish(tmp_path, "diagnose", "diagnosis.json")
    assert page_owner(tmp_path) == "diagnosis"
    finish(tmp_path, "select", "models.csv")
    assert page_owner(tmp_path) == "selection"
    (tmp_path / "report.html").write_text("a calibration's again")
    assert page_owner(tmp_path) == "calibration"


def test_only_another_command_s_page_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    finish(tmp_path, "select", "models.csv")
    tell_replaced(tmp_path, "selection")
    assert capsys.readouterr().err == ""
    tell_replaced(tmp_path, "diagnosis")
    page = tmp_path / "report.html"
    assert capsys.readouterr().err == f"note: {page} is of a selection; this diagnosis will replace it\n"


@pytest.mark.parametrize(
    ("command", "own"), [("select", "selection"), ("diagnose", "diagnosis"), ("calibrate", "calibration")]
)
def test_a_command_says_so_before_it_starts(
    command: str, own: str, muscle: Path, run_copy: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(*arguments: object, listener: Listener | None = None, **options: object) -> NoReturn:
        for _ in range(2 * (listener is not None)):
            listener(Progress("sampling", 1, 1.0, 1.0, 0.1))
        raise KeyboardInterrupt

    monkeypatch.setattr(f"mpam_calib.run.{command}.{command}", stop)
    owner = "calibration"
    if command == "calibrate":
        finish(run_copy, "select", "models.csv")
        owner = "selection"
    lines = here(command, muscle, "-o", run_copy).unremarked.splitlines()
    assert lines[0] == f"note: {run_copy / 'report.html'} is of a {owner}; this {own} will replace it"
    assert len(lines) == 2


@pytest.mark.parametrize("command", ["select", "diagnose", "calibrate"])
def test_a_command_that_refuses_replaces_nothing_and_says_nothing_of_it(
    command: str, run_copy: Path, tmp_path: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mpam_calib.run.calibrate.calibrate", refuse)
    if command == "calibrate":
        finish(run_copy, "select", "models.csv")
    pressure = np.linspace(100.0, 200.0, 9)
    blocked = csv_text({"pressure_kPa": pressure, "force_N": 0.1 * pressure})
    specimen = Specimen().write(tmp_path / "blocked", blocked_force=blocked)
    result = here(command, specimen, "-o", run_copy)
    assert result.code == 2
    assert result.complaint.startswith("error: ")
    assert ("no finite probability" if command == "calibrate" else "no loops") in result.complaint
