from __future__ import annotations

import errno
import os
import shlex
import sys
from pathlib import Path

import pytest

from mpam_calib.cli import main
from mpam_calib.specimen import read

from .folders import loops


def run(*arguments: str) -> int:
    sys.argv = ["mpam-calib", *arguments]
    with pytest.raises(SystemExit) as exit_:
        main()
    code = exit_.value.code
    return int(code or 0)


@pytest.fixture(autouse=True)
def _keep_arguments(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", list(sys.argv))


def test_passes_check_but_for_the_missing_data(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new" / "muscle"
    assert run("init", str(folder)) == 0
    capsys.readouterr()
    assert run("check", str(folder)) == 2
    assert f"{folder / 'loops.csv'}: found no such file" in capsys.readouterr().err
    (folder / "loops.csv").write_text(loops(rate=20.0).text())
    assert run("check", str(folder)) == 0


def test_the_next_command_can_be_pasted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "new dir" / "x y's"
    assert run("init", str(folder)) == 0
    command = capsys.readouterr().out.partition("then run: ")[2]
    assert shlex.split(command) == ["mpam-calib", "check", str(folder)]


def test_never_overwrites(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "specimen.toml").write_text("mine")
    assert run("init", str(tmp_path)) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert (tmp_path / "specimen.toml").read_text() == "mine"


def test_every_optional_key_of_the_template_is_a_real_one(tmp_path: Path) -> None:
    assert run("init", str(tmp_path)) == 0
    lines = (tmp_path / "specimen.toml").read_text().splitlines()
    alternatives = ("# E_Pa", "# E_rel", "# loops =", "# skip_rows", "# delimiter", "# decimal")
    opened = [
        line[2:] if line.startswith("# ") and ("=" in line or "[" in line[:4]) else line
        for line in lines
        if not line.startswith(alternatives) and "mpam-calib" not in line
    ]
    text = "\n".join(line for line in opened if not line.startswith(("force_N = {", "pressure_kPa = {")))
    (tmp_path / "specimen.toml").write_text(text)
    for name, content in {
        "loops": loops(rate=20.0).text(),
        "force_map": "pressure_kPa,contraction,force_N\n50,0,5\n",
        "blocked_force": "pressure_kPa,force_N\n50,5\n",
        "free_contraction": "pressure_kPa,contraction\n50,0.1\n",
        "tensile": "strain,stress_Pa\n" + "\n".join(f"{i / 10},{i}" for i in range(20)),
    }.items():
        (tmp_path / f"{name}.csv").write_text(content + "\n")
    specimen = read(tmp_path)
    assert specimen.braid is not None and specimen.geometry is not None
    assert specimen.geometry.sd.alpha0_deg == 1.0
    assert specimen.noise.growth and specimen.noise.robust
    assert specimen.fit.tensile_strain == (0.1, 3.0)


@pytest.mark.parametrize("kind", [PermissionError, OSError])
def test_a_folder_that_may_not_be_written(
    kind: type[OSError],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its own right, or a disk that is mounted to read only."""
    number = errno.EACCES if kind is PermissionError else errno.EROFS

    def refuse(self: Path, *arguments: object, **options: object) -> None:
        raise kind(number, os.strerror(number), str(self))

    monkeypatch.setattr(Path, "mkdir", refuse)
    assert run("init", str(tmp_path / "new")) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {tmp_path}: found a folder that may not be written (")
    assert said.endswith(", expected one that may\n") and "read)" not in said


def test_a_file_in_the_way(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("mine")
    assert run("init", str(tmp_path / "file" / "new")) == 2
    assert f"error: {tmp_path / 'file'}: found a file, expected a folder" in capsys.readouterr().err
