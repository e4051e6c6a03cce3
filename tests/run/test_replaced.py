"""Whose page a command is about to replace is told before it starts."""

from __future__ import annotations

from pathlib import Path
from typing import NoReturn

import pytest

from mpam_calib.run.kept import Kept
from mpam_calib.run.replaced import page_owner, tell_replaced

from .command import Here


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
    def stop(*arguments: object, **options: object) -> NoReturn:
        raise KeyboardInterrupt

    monkeypatch.setattr(f"mpam_calib.run.{command}.{command}", stop)
    owner = "calibration"
    if command == "calibrate":
        finish(run_copy, "select", "models.csv")
        owner = "selection"
    lines = here(command, muscle, "-o", run_copy).err.splitlines()
    assert lines[0] == f"note: {run_copy / 'report.html'} is of a {owner}; this {own} will replace it"
