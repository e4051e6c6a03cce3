"""The same loops, however a rig writes them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpam_calib.errors import InputError
from mpam_calib.specimen import read
from mpam_calib.specimen.blocks import read_blocks
from mpam_calib.specimen.declaration import Csv
from mpam_calib.specimen.tables import TABLES
from mpam_calib.specimen.text_format import detect_format

from .folders import DECLARATION, HEADER, loops, make

PLAIN = loops().text()


def quoted(text: str) -> str:
    return "\n".join(",".join(f'"{cell}"' for cell in row.split(",")) for row in text.splitlines())


def extra(text: str) -> str:
    lines = text.splitlines()
    return "\n".join([f'note,{lines[0]},"a, b"', *(f'01.02.2024 10:00,{row},"x, y"' for row in lines[1:])])


FORMATS: dict[str, bytes] = {
    "BOM": b"\xef\xbb\xbf" + PLAIN.encode(),
    "CRLF": PLAIN.replace("\n", "\r\n").encode(),
    "CR only": PLAIN.replace("\n", "\r").encode(),
    "no newline at the end": PLAIN.rstrip("\n").encode(),
    "blank rows": PLAIN.replace("\n", "\n\n", 3).encode() + b"\n  \n",
    "semicolons": PLAIN.replace(",", ";").encode(),
    "semicolons with decimal commas": PLAIN.replace(",", ";").replace(".", ",").encode(),
    "tabs": PLAIN.replace(",", "\t").encode(),
    "tabs with decimal commas": PLAIN.replace(",", "\t").replace(".", ",").encode(),
    "spaces": PLAIN.replace(",", " , ").encode(),
    "quoted": quoted(PLAIN).encode(),
    "quoted with decimal commas": quoted(PLAIN).replace(".", ",").encode(),
    "extra columns": extra(PLAIN).encode(),
    "a degree sign of Windows": PLAIN.replace("\n", ";\n")
    .replace(",", ";")
    .encode()
    .replace(b"N;", b"N;\xb0C"),
    "a spreadsheet's blank rows": PLAIN.replace("\n", "\n,,,\n", 3).encode() + b",,,\n , , ,\n",
    "a row of units": PLAIN.replace("\n", "\ns,kPa,mm,N\n", 1).encode(),
    "units in brackets, below a blank row": PLAIN.replace("\n", "\n\n[s],[kPa],[mm],(N)\n", 1).encode(),
    "rows before the header": b"Rig 7, operator X\nDate;2024-01-01\n\n" + PLAIN.encode(),
}


@pytest.mark.parametrize("name", FORMATS)
def test_every_format_gives_the_same_rows(name: str, tmp_path: Path) -> None:
    folder = make(tmp_path)
    (folder / "loops.csv").write_bytes(FORMATS[name])
    found = read(folder).loops
    assert found is not None
    columns = np.column_stack(
        [found.time_s, found.pressure_Pa / 1e3, found.displacement_m * 1e3, found.force_N]
    )
    assert columns == pytest.approx(loops().columns(), abs=1e-5)


def test_a_unit_that_a_declared_scale_accounts_for(tmp_path: Path) -> None:
    lines = PLAIN.splitlines()
    cells = [line.split(",") for line in lines[1:]]
    bars = [f"{a},{float(b) / 100.0:.8f},{c},{d}" for a, b, c, d in cells]
    mapping = '\n[columns.loops]\npressure_kPa = { name = "p", scale = 100.0 }\n'
    text = "\n".join(["time_s,p,displacement_mm,force_N", "s,bar,mm,N", *bars]) + "\n"
    found = read(make(tmp_path, DECLARATION + mapping, loops=text)).loops
    assert found is not None
    assert found.pressure_Pa / 1e3 == pytest.approx(loops().pressure, abs=1e-5)


def test_decimal_commas_that_appear_late(tmp_path: Path) -> None:
    rows = [f"{i};50;{i % 20};3" for i in range(30_000)] + ["30000,5;50;1;3"]
    (tmp_path / "loops.csv").write_text("\n".join([HEADER.replace(",", ";"), *rows]))
    spec = TABLES["loops"]
    form = detect_format(tmp_path / "loops.csv", "loops.csv", spec, Csv(), {})
    frames = list(read_blocks(tmp_path / "loops.csv", "loops.csv", spec, form))
    assert frames[-1]["time_s"].iloc[-1] == 30000.5
    assert frames[-1].index[-1] == 30002


def test_declared_format(tmp_path: Path) -> None:
    text = "made by;rig 3\nunits, below\n" + PLAIN.replace(",", "|")
    declaration = DECLARATION + '[csv]\ndelimiter = "|"\ndecimal = "."\nskip_rows = 2\n'
    assert read(make(tmp_path, declaration, loops=text)).files[0].delimiter == "|"


def test_rows_to_skip_in_one_file_are_not_skipped_in_another(tmp_path: Path) -> None:
    declaration = DECLARATION.replace("[files]\n", '[files]\nblocked_force = "blocked_force.csv"\n')
    folder = make(tmp_path, declaration + "[csv]\nskip_rows = 2\n", loops="rig 3\nunits, below\n" + PLAIN)
    (folder / "blocked_force.csv").write_text("pressure_kPa,force_N\n50,3.5\n75,6\n100,9\n")
    found = read(folder)
    assert found.blocked_force is not None
    assert found.blocked_force.force_N == pytest.approx([3.5, 6.0, 9.0])


@pytest.mark.parametrize("skipped", [3, 40, 10_000])
def test_rows_to_skip_do_not_go_past_the_header(skipped: int, tmp_path: Path) -> None:
    """Nor past the file's end."""
    declaration = DECLARATION + f"[csv]\nskip_rows = {skipped}\n"
    with pytest.raises(InputError) as refused:
        read(make(tmp_path, declaration, loops="rig 3\nunits, below\n" + PLAIN))
    line = declaration.splitlines().index(f"skip_rows = {skipped}") + 1
    assert str(refused.value).endswith(
        f'specimen.toml:{line}:csv.skip_rows: found {skipped}, with the header of "loops.csv" in row 3, '
        "expected the number of rows above it (2)"
    )


def test_a_header_that_is_nowhere_is_missed_where_it_is_declared(tmp_path: Path) -> None:
    text = "made by;rig 3\nunits, below\nt,p,x,F\n" + PLAIN.partition("\n")[2]
    with pytest.raises(InputError, match=r"loops.csv:3"):
        read(make(tmp_path, DECLARATION + "[csv]\nskip_rows = 2\n", loops=text))


def test_a_rigs_own_columns(tmp_path: Path) -> None:
    recording = loops()
    lines = recording.text("Time,p/bar,Travel,Load").splitlines()
    table = [[float(cell) for cell in line.split(",")] for line in lines[1:]]
    rows = [f"{t * 1000!r},{p / 100!r},{30 - x!r},{-f!r}" for t, p, x, f in table]
    declaration = DECLARATION + (
        "[columns.loops]\n"
        'time_s = { name = "Time", scale = 0.001 }\n'
        'pressure_kPa = { name = "p/bar", scale = 100.0 }\n'
        'displacement_mm = { name = "Travel", scale = -1.0, offset = 30.0 }\n'
        'force_N = { name = "Load", scale = -1.0 }\n'
    )
    found = read(make(tmp_path, declaration, loops="\n".join([lines[0], *rows]))).loops
    assert found is not None
    assert found.pressure_Pa == pytest.approx(recording.pressure * 1e3)
    assert found.displacement_m == pytest.approx(recording.displacement * 1e-3, abs=1e-8)
    assert found.force_N == pytest.approx(recording.force, abs=1e-5)
    assert found.time_s == pytest.approx(recording.time)


def test_one_column_of_the_rig_for_two_of_the_package(tmp_path: Path) -> None:
    recording = loops()
    declaration = DECLARATION + '[columns.loops]\npressure_kPa = "p"\nsetpoint_kPa = "p"\n'
    text = recording.text("time_s,p,displacement_mm,force_N")
    specimen = read(make(tmp_path, declaration, loops=text))
    assert specimen.loops is not None
    assert specimen.loops.pressure_Pa == pytest.approx(recording.pressure * 1e3)
    assert specimen.levels_Pa == pytest.approx([50e3, 100e3, 150e3])


NUMBERS = st.floats(-1e12, 1e12, allow_nan=False).filter(lambda value: value == 0 or abs(value) > 1e-12)


@given(st.lists(NUMBERS, min_size=1, max_size=20), st.sampled_from([".", ","]))
@settings(max_examples=60, deadline=None)
def test_numbers_survive_both_decimal_marks(
    tmp_path_factory: pytest.TempPathFactory, values: list[float], mark: str
) -> None:
    file = tmp_path_factory.mktemp("numbers") / "blocked_force.csv"
    rows = [f"{value!r};1".replace(".", mark) for value in values]
    file.write_text("\n".join(["force_N;pressure_kPa", *rows]))
    spec = TABLES["blocked_force"]
    form = detect_format(file, "f", spec, Csv(), {})
    found = [value for block in read_blocks(file, "f", spec, form) for value in block["force_N"]]
    assert found == pytest.approx(values, rel=1e-14)


def test_a_last_cell_that_is_cut_off_is_refused(tmp_path: Path) -> None:
    """A logger that lost its power: 1 for 14.25000 is a number, too."""
    last = len(PLAIN.splitlines())
    exponents = "\n".join([HEADER, *(",".join(f"{v:.5E}" for v in row) for row in loops().columns())])
    for name, text in (("digits", PLAIN[:-4]), ("all digits", PLAIN[:-8]), ("exponent", exponents[:-1])):
        with pytest.raises(InputError, match=rf"loops.csv:{last}:force_N: found .* \(cut off\?\), expected"):
            read(make(tmp_path / name, loops=text))


def test_a_last_cell_that_is_merely_short_is_read(tmp_path: Path) -> None:
    """Numbers without zeros at their end, of which the last is whole."""
    columns = loops().columns()
    columns[:, 3] = 22.1
    columns[0, 3], columns[-1, 3] = 22.25, 22.0
    text = "\n".join([HEADER, *(",".join(f"{value:.6g}" for value in row) for row in columns)])
    found = read(make(tmp_path, loops=text)).loops
    assert found is not None and found.force_N[-1] == 22.0


@pytest.mark.parametrize("separator", [".", ","])
def test_thousands_that_are_parted_are_refused(separator: str, tmp_path: Path) -> None:
    """Whole numbers alone show no decimal mark that would contradict."""
    lines = [HEADER.replace(",", ";")]
    for row in loops().columns():
        force = f"{row[3] * 30.0:,.0f}".replace(",", separator)
        lines.append(f"{row[0] * 10.0:.0f};{row[1]:.0f};{row[2]:.0f};{force}")
    first = next(i for i, line in enumerate(lines[1:], start=2) if separator in line)
    with pytest.raises(InputError, match=rf"loops.csv:{first}:force_N: found .* \(a thousands separator\?\)"):
        read(make(tmp_path, loops="\n".join(lines) + "\n"))


def test_a_column_that_is_not_read_for_its_spelling_is_said(tmp_path: Path) -> None:
    recording = loops()
    setpoint = [f"{value:g}" for value in recording.pressure]
    body = PLAIN.splitlines()
    rows = [f"{row},{cell},x" for row, cell in zip(body[1:], setpoint, strict=True)]
    specimen = read(make(tmp_path, loops="\n".join([f"{body[0]},Setpoint_kPa,Note", *rows]) + "\n"))
    said = [note for note in specimen.notes if "is not read" in note]
    mapped = 'setpoint_kPa = "Setpoint_kPa" in [columns.loops]'
    assert said == [f'loops: the column "Setpoint_kPa" is not read; {mapped} would do']


def test_a_second_header_is_refused_as_such(tmp_path: Path) -> None:
    lines = PLAIN.splitlines()
    text = "\n".join([*lines[:100], lines[0], *lines[100:]]) + "\n"
    with pytest.raises(InputError, match=r'loops.csv:101:time_s: found "time_s", the header again, expected'):
        read(make(tmp_path, loops=text))
