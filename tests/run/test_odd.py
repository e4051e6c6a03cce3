"""A calibration tells what looks odd in its data, beside its results and never before a refusal."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from mpam_calib.run.odd import tell_odd
from mpam_calib.specimen import read
from mpam_calib.specimen.oddities import oddities

from .command import FAST, Here, refuse
from .small import Specimen, tensile_text


def test_few_lines_are_told_as_check_does(muscle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    specimen = read(muscle)
    (line,) = oddities(specimen)
    tell_odd(specimen, muscle)
    assert capsys.readouterr() == ("", f"odd: {line}\n")


def test_of_many_their_number_is(muscle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    odd = replace(read(muscle), notes=("a", "b", "c", "d"))
    tell_odd(odd, "my muscle")
    said = capsys.readouterr().err
    assert said == "odd: 4 remarks on these data; see mpam-calib check 'my muscle'\n"


def test_calibrate_tells_them_and_its_output_stays(tmp_path: Path, here: Here) -> None:
    simulation = '[simulation]\nmoduli = "tensile"\norder = 2\nlaw = "constant"\n'
    specimen = Specimen(geometry="", simulation=simulation)
    text = "\n".join(
        line if "strain" in line else f"{line.split(',')[0]},{1e-6 * float(line.split(',')[1]):.9g}"
        for line in tensile_text().splitlines()
    )
    folder = specimen.write(tmp_path / "in_mpa", tensile=text + "\n")
    first = here("calibrate", folder, "-o", tmp_path / "run", *FAST)
    assert first.code == 0, first.err
    assert first.err.startswith("odd: tensile: a stiffness of about ") and first.err.count("\n") == 1
    assert first.out.splitlines() == [f"{tmp_path / 'run' / 'report.html'} written"]
    kept = here("calibrate", folder, "-o", tmp_path / "run", *FAST)
    assert (kept.code, kept.err) == (0, "")


def test_what_is_refused_is_told_in_one_line_all_the_same(
    muscle: Path, tmp_path: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mpam_calib.run.calibrate.calibrate", refuse)
    refused = here("calibrate", muscle, "-o", tmp_path / "run")
    assert refused.code == 2
    assert refused.err.startswith("error: the data") and refused.err.count("\n") == 1
