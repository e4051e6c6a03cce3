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


PREAMBLE = "Specimen label,7\nLoad cell,kN,50,\n\n"
NONE = "s1,p1,x1,f1"


@pytest.mark.parametrize(
    ("header", "row", "said"),
    [
        pytest.param(f"{PREAMBLE}Time,Pressure,Extension,Load", 4, 'time_s = "Time"', id="known words"),
        pytest.param(
            f"{PREAMBLE}Time,Pressure,Extension,Load\ns,kPa,mm,N", 4, "", id="known words and units"
        ),
        pytest.param(f"{PREAMBLE}{NONE}", 4, "", id="words above the numbers"),
        pytest.param(f"{PREAMBLE}{NONE}\n(s),(kPa),(mm),(N)", 4, "", id="words above units"),
        pytest.param(NONE, 1, "", id="no preamble"),
        pytest.param("0.0,1.0,2.0,3.0", 1, "", id="no header"),
    ],
)
def test_a_header_of_own_names_is_found_below_a_preamble(
    header: str, row: int, said: str, tmp_path: Path
) -> None:
    message = refused(tmp_path, header)
    names = header.splitlines()[row - 1].replace(",", '", "')
    assert f'loops.csv:{row}:time_s: found the columns "{names}", expected' in message
    assert said in message


def test_a_preamble_that_names_a_column_hides_no_header(tmp_path: Path) -> None:
    """Words that could mean columns count only where no row has a column's own name."""
    made = loops().text()
    found = read(make(tmp_path, loops="Time,Pressure,Displacement,Load\n" + made)).loops
    assert found is not None and len(found.time_s) == len(made.splitlines()) - 1


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
