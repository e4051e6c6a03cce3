"""A rig's own column names: what is missing, and the map that check offers for it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read

from .folders import DECLARATION, loops, make


def refused(folder: Path, header: str, declared: str = "") -> str:
    text = DECLARATION.replace("[simulation]", f"{declared}\n[simulation]")
    body = loops().text().split("\n", 1)[1]
    with pytest.raises(InputError) as caught:
        read(make(folder, text, loops=f"{header}\n{body}"))
    return str(caught.value)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        pytest.param(
            "Time,Pressure,Extension,Load",
            'expected the columns "time_s", "pressure_kPa", "displacement_mm", "force_N", or in '
            'specimen.toml [columns.loops] time_s = "Time", pressure_kPa = "Pressure", force_N = "Load"',
            id="all four, one that has no safe guess",
        ),
        pytest.param(
            "Time (s),Pressure (bar),Displacement (mm),Force (N)",
            'time_s = "Time (s)", pressure_kPa = { name = "Pressure (bar)", scale = 100 }, '
            'displacement_mm = "Displacement (mm)", force_N = "Force (N)"',
            id="units",
        ),
        pytest.param(
            "Time_s,Pressure_kPa,Displacement_mm,Force_N",
            'time_s = "Time_s", pressure_kPa = "Pressure_kPa", displacement_mm = "Displacement_mm"',
            id="capitals",
        ),
        pytest.param(
            "time_s,Pressure_bar,displacement_mm,force_N",
            'pressure_kPa = { name = "Pressure_bar", scale = 100 }',
            id="a unit behind a line",
        ),
        pytest.param("time_s,pressure_psia,displacement_mm,force_N", "(or [columns] that", id="unknown unit"),
        pytest.param("Load 1,Load 2,a,b", "(or [columns] that say how they are called)", id="none"),
        pytest.param(
            "time_s,p,displacement_mm,force_N", '"pressure_kPa" (or [columns] that say how it', id="one"
        ),
    ],
)
def test_all_that_is_missing_is_said_at_once(header: str, said: str, tmp_path: Path) -> None:
    message = refused(tmp_path, header)
    assert said in message and "\n" not in message


def test_the_map_that_is_offered_is_read(tmp_path: Path) -> None:
    header = "Time (s),Pressure (bar),Displacement,Load"
    offered = refused(tmp_path / "a", header).partition("[columns.loops] ")[2]
    lines = offered.replace(", pressure_kPa", "\npressure_kPa").replace(", displacement", "\ndisplacement")
    table = lines.replace(", force_N", "\nforce_N")
    assert len(tomllib.loads(table)) == 4
    text = DECLARATION.replace("[simulation]", f"[columns.loops]\n{table}\n[simulation]")
    rows = [line.split(",") for line in loops().text().splitlines()[1:]]
    body = "".join(f"{t},{float(p) / 100.0},{x},{f}\n" for t, p, x, f in rows)
    specimen = read(make(tmp_path / "b", text, loops=f"{header}\n{body}"))
    assert specimen.levels_Pa == pytest.approx([5e4, 1e5, 1.5e5])


def test_a_name_that_the_declaration_gets_wrong_is_guessed(tmp_path: Path) -> None:
    message = refused(
        tmp_path, "time_s,pressure_kPa,displacement_mm,Load", '[columns.loops]\nforce_N = "Laod"'
    )
    assert '(did you mean "Load"?), expected a column "Laod" (for force_N)' in message


@pytest.mark.parametrize(("cell", "said"), [("00:00:00.100", True), ("0h", False)])
def test_a_clock_time_is_no_time_in_seconds(cell: str, said: bool, tmp_path: Path) -> None:
    lines = loops().text().splitlines()
    lines[2] = ",".join([cell, *lines[2].split(",")[1:]])
    with pytest.raises(InputError) as caught:
        read(make(tmp_path, loops="\n".join(lines) + "\n"))
    expected = f'loops.csv:3:time_s: found "{cell}" (a clock time?), expected seconds'
    assert (expected in str(caught.value)) == said
