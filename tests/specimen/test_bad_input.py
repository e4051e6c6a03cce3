"""Everything that a user can get wrong ends in one line that says where, what, and what instead."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from mpam_calib.cli import main

from .folders import DECLARATION, HEADER, good, loops

Spoil = Callable[[Path], object]


def toml(old: str, new: str) -> Spoil:
    def spoil(folder: Path) -> None:
        text = (folder / "specimen.toml").read_text()
        assert old in text
        (folder / "specimen.toml").write_text(text.replace(old, new))

    return spoil


def append(text: str) -> Spoil:
    return lambda folder: (folder / "specimen.toml").open("a").write(text)


def rows(change: Callable[[list[str]], list[str]]) -> Spoil:
    """Change the rows of loops.csv; row 1 is the header, so row n is element n - 1."""

    def spoil(folder: Path) -> None:
        lines = (folder / "loops.csv").read_text().splitlines()
        (folder / "loops.csv").write_text("\n".join(change(lines)) + "\n")

    return spoil


def cell(row: int, column: int, value: str) -> Spoil:
    def change(lines: list[str]) -> list[str]:
        cells = lines[row - 1].split(",")
        cells[column] = value
        lines[row - 1] = ",".join(cells)
        return lines

    return rows(change)


def scaled(column: int, factor: float) -> Spoil:
    def change(lines: list[str]) -> list[str]:
        table = [line.split(",") for line in lines[1:]]
        for cells in table:
            cells[column] = f"{float(cells[column]) * factor:.6f}"
        return [lines[0], *(",".join(cells) for cells in table)]

    return rows(change)


def raw(content: bytes) -> Spoil:
    return lambda folder: (folder / "loops.csv").write_bytes(content)


def utf16(folder: Path) -> None:
    (folder / "loops.csv").write_text((folder / "loops.csv").read_text(), encoding="utf-16")


def mixed_marks(lines: list[str]) -> list[str]:
    lines = [line.replace(",", ";").replace(".", ",") for line in lines]
    return [*lines[:9], lines[9].replace(",", "."), *lines[10:]]


def outside(folder: Path) -> None:
    (folder.parent / "loops.csv").write_text((folder / "loops.csv").read_text())
    toml('"loops.csv"', '"../loops.csv"')(folder)


def with_branch(word: str) -> Spoil:
    def change(lines: list[str]) -> list[str]:
        body = [
            f"{line},{word if number == 7 else 'loading'}" for number, line in enumerate(lines[1:], start=2)
        ]
        return [lines[0] + ",branch", *body]

    return rows(change)


def swapped(folder: Path) -> None:
    """The words for the directions, and for most rows the wrong ones."""

    def change(lines: list[str]) -> list[str]:
        x = [float(line.split(",")[2]) for line in lines[1:]]
        rises = [after >= before for before, after in zip(x, [*x[1:], x[-1]], strict=True)]
        words = ["loading" if rising else "unloading" for rising in rises]
        return [lines[0] + ",branch", *(f"{a},{b}" for a, b in zip(lines[1:], words, strict=True))]

    rows(change)(folder)


CASES: dict[str, tuple[Spoil, list[str]]] = {
    "missing file": (lambda f: (f / "loops.csv").unlink(), ["loops.csv: found no such file"]),
    "empty file": (raw(b""), ["loops.csv: found an empty file"]),
    "only blank lines": (raw(b"\n\r\n  \n"), ["loops.csv: found an empty file"]),
    "header only": (raw(HEADER.encode() + b"\n"), ["loops.csv: found a header and no rows"]),
    "missing column": (
        rows(lambda lines: [lines[0].replace("force_N", "Force_n"), *lines[1:]]),
        ["loops.csv:1:force_N: ", 'did you mean "Force_n"?', 'a column "force_N"'],
    ),
    "no header": (rows(lambda lines: lines[1:]), ["loops.csv:1:time_s: ", 'expected the columns "time_s"']),
    "column twice": (
        rows(lambda lines: [line + (",force_N" if not i else ",1.0") for i, line in enumerate(lines)]),
        ['loops.csv:1:force_N: found "force_N" twice'],
    ),
    "a temperature in words": (
        rows(
            lambda lines: [
                line + (",warm" if i == 9 else ",") if i else line + ",temperature_C"
                for i, line in enumerate(lines)
            ]
        ),
        ['loops.csv:10:temperature_C: found "warm", expected a number'],
    ),
    "text": (cell(12, 3, "abc"), ['loops.csv:12:force_N: found "abc", expected a number']),
    "empty cell": (cell(12, 1, ""), ["loops.csv:12:pressure_kPa: found an empty cell"]),
    "NaN": (cell(5, 2, "NaN"), ['loops.csv:5:displacement_mm: found "NaN", expected a number']),
    "infinite": (cell(6, 3, "inf"), ["loops.csv:6:force_N: found inf, expected a finite number"]),
    "overflow": (cell(6, 3, "1e999"), ["loops.csv:6:force_N: found inf"]),
    "hexadecimal": (cell(6, 3, "0x10"), ['loops.csv:6:force_N: found "0x10"']),
    "no pressure": (scaled(1, -0.5), ["loops.csv:", "flipped sign?"]),
    "below a vacuum": (scaled(1, -3.0), ["loops.csv:2:pressure_kPa: found a pressure level of -", "vacuum"]),
    "a force that rests": (scaled(3, 0.0), ["loops.csv:force_N: found a force that never changes (0 "]),
    "branches swapped": (
        swapped,
        ["loops.csv:", ":branch: found loading where displacement_mm rises (swapped?)"],
    ),
    "all slack": (
        toml("[files]", "[sensors]\nforce_floor_N = 1e6\n[files]"),
        ["loops.csv:force_N: found every row slack"],
    ),
    "angle from the axis": (
        toml("72.0", "18.0"),
        [
            "specimen.toml:8:geometry.alpha0_deg: found 18, a braid that lengthens",
            "above 35.3 degrees",
            "72?",
        ],
    ),
    "geometry that nobody knows": (
        toml("[files]", "[geometry.sd]\nR0_mm = 50.0\n[files]"),
        ["sd of R0_mm = 50", "one sigma below R0_mm = 3 itself"],
    ),
    "friction twice": (
        append('effects = ["coulomb_friction"]\n'),
        ['"coulomb_friction" beside friction = "coulomb"'],
    ),
    "kinematics twice": (
        append('effects = ["braid_kinematics"]\n'),
        ['"braid_kinematics" beside kinematics = "inextensible_braid"'],
    ),
    "short row": (
        rows(lambda lines: [*lines[:8], "0.9,50.0", *lines[9:]]),
        ["loops.csv:9: found a row of 2 cells, expected 4"],
    ),
    "cut off": (rows(lambda lines: [*lines[:-1], lines[-1].rsplit(",", 1)[0]]), ["found a row of 3 cells"]),
    "long row": (
        rows(lambda lines: [*lines[:8], lines[8] + ",1", *lines[9:]]),
        ["loops.csv:9: found a row of 5"],
    ),
    "decimal commas between commas": (
        rows(lambda lines: [lines[0], *(line.replace(".", ",") for line in lines[1:])]),
        ["loops.csv:2: found a row of 8 cells", "decimal comma"],
    ),
    "backward time": (cell(10, 0, "0.1"), ["loops.csv:10:time_s: found 0.1 after 0.7", "later"]),
    "duplicate time": (cell(10, 0, "0.70000"), ["loops.csv:10:time_s: ", "again"]),
    "pascals": (scaled(1, 1e3), ["loops.csv:2:pressure_kPa: ", "pascals", "scale = 0.001"]),
    "metres": (scaled(2, 1e-3), ["loops.csv:displacement_mm: ", "metres", "scale = 1000"]),
    "flipped sign": (scaled(3, -1.0), ["loops.csv:force_N: ", "flipped", "scale = -1.0"]),
    "flipped displacement": (
        scaled(2, -1.0),
        ["loops.csv:displacement_mm: found a largest displacement of", "flipped", "scale = -1.0"],
    ),
    "lengthening alone": (scaled(2, -0.2), ["loops.csv:displacement_mm: ", "flipped", "scale = -1.0"]),
    "a units row in bar": (
        rows(lambda lines: [lines[0], "s,bar,mm,N", *lines[1:]]),
        ['loops.csv:2:pressure_kPa: found the unit "bar", expected kPa, or scale = 100 for it in'],
    ),
    "words below the header": (
        rows(lambda lines: [lines[0], "a,b,c,d", *lines[1:]]),
        ['loops.csv:2:time_s: found "a", expected a number'],
    ),
    "lengths": (scaled(2, 50.0), ["displacement_mm: ", "a shortening below L0"]),
    "never moves": (scaled(2, 0.0), ["loops.csv:displacement_mm: found a displacement that never moves"]),
    "binary": (raw(b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR"), ["loops.csv: found a binary file"]),
    "binary further on": (
        lambda f: (f / "loops.csv").open("ab").write(b"\x00\x01\x02\n"),
        ["loops.csv: found a binary file"],
    ),
    "UTF-16": (utf16, ["loops.csv: found UTF-16 text"]),
    "UTF-16 without its mark": (
        lambda f: (f / "loops.csv").write_text((f / "loops.csv").read_text(), encoding="utf-16-le"),
        ["loops.csv: found UTF-16 text"],
    ),
    "mixed decimal marks": (rows(mixed_marks), ["loops.csv:10:time_s: ", "mixed decimal marks"]),
    "unclosed quote": (cell(10, 3, '"1.0'), ["loops.csv:10"]),
    "branch word": (
        with_branch("laoding"),
        ['loops.csv:7:branch: found the unknown word "laoding"', '"loading"?'],
    ),
    "cycle zero": (
        rows(lambda lines: [line + (",cycle" if not i else ",0") for i, line in enumerate(lines)]),
        ["loops.csv:2:cycle: found 0, expected a whole number from 1"],
    ),
    "folder as file": (
        lambda f: ((f / "loops.csv").unlink(), (f / "loops.csv").mkdir()),
        ["loops.csv: found a folder"],
    ),
    "file outside": (outside, ["specimen.toml:11:files.loops: ", "outside the specimen's folder"]),
    "absolute file outside": (toml('"loops.csv"', '"/etc/hostname"'), ["outside the specimen's folder"]),
    "absolute file inside": (
        lambda f: toml('"loops.csv"', f'"{(f / "loops.csv").as_posix()}"')(f),
        ["specimen.toml:11:files.loops: ", "a path from outside the specimen's folder"],
    ),
    "file inside by way of outside": (
        lambda f: toml('"loops.csv"', f'"../{f.name}/loops.csv"')(f),
        ["specimen.toml:11:files.loops: ", "a path from outside the specimen's folder"],
    ),
    "file twice": (toml('"loops.csv"', '["loops.csv", "loops.csv"]'), ["twice"]),
    "fewer rows than parameters": (
        rows(lambda lines: lines[:1] + lines[1 :: len(lines) // 4][:4]),
        ["4 rows of data, expected at least 6"],
    ),
    "one level": (
        lambda f: (f / "loops.csv").write_text(loops((50.0,)).text()),
        ['specimen.toml:16:simulation.law: found law "linear" with 1 pressure level (', "at least 2"],
    ),
    "two levels for an exponential": (
        lambda f: (
            toml('"linear"', '"exponential"')(f),
            (f / "loops.csv").write_text(loops((50.0, 99.0)).text()),
        ),
        ["simulation.law: ", "at least 3"],
    ),
    "no declaration": (lambda f: (f / "specimen.toml").unlink(), ["specimen.toml: found no such file"]),
    "syntax": (toml("L0_mm = 50.0", "L0_mm = "), ["specimen.toml:5: found a TOML syntax error"]),
    "syntax at the end": (append("[fit"), ["specimen.toml", "TOML syntax error"]),
    "TOML not text": (
        lambda f: (f / "specimen.toml").write_bytes(b"\xff\xfe[\x00"),
        ["specimen.toml: found UTF-16 text"],
    ),
    "misspelt key": (toml("t0_mm", "to_mm"), ["specimen.toml:7:geometry.to_mm: ", 'did you mean "t0_mm"?']),
    "misspelt table": (
        toml("[geometry]", "[geometri]"),
        ["specimen.toml:4:geometri: ", 'did you mean "geometry"?'],
    ),
    "misspelt nested key": (
        append("[geometry.sd]\nalfa0_deg = 1.0\n"),
        ["specimen.toml:18:geometry.sd.alfa0_deg: ", 'did you mean "alpha0_deg"?'],
    ),
    "misspelt file kind": (toml("loops =", "loop ="), ['did you mean "loops"?']),
    "missing key": (toml("L0_mm = 50.0\n", ""), ["specimen.toml:4:geometry.L0_mm: "]),
    "missing table": (
        toml('[specimen]\nname = "Test muscle"', ""),
        ["specimen.toml:specimen: found no table"],
    ),
    "number as text": (
        toml("L0_mm = 50.0", 'L0_mm = "50"'),
        ['specimen.toml:5:geometry.L0_mm: found the text "50", expected a number (without quotes)'],
    ),
    "wall as thick as the radius": (
        toml("t0_mm = 0.7", "t0_mm = 3.0"),
        ["t0_mm = 3", "thinner than R0_mm = 3"],
    ),
    "angle too large": (
        toml("72.0", "90.0"),
        ["specimen.toml:8:geometry.alpha0_deg: found 90", "between 0 and 90"],
    ),
    "angle too small": (
        toml("72.0", "0.0"),
        ["specimen.toml:8:geometry.alpha0_deg: found 0", "between 0 and 90"],
    ),
    "negative length": (toml("50.0", "-50.0"), ["specimen.toml:5:geometry.L0_mm: found -50", "above 0"]),
    "not a number": (toml("50.0", "nan"), ["specimen.toml:5:geometry.L0_mm: found nan"]),
    "unknown law": (toml('"linear"', '"liner"'), ['simulation.law: found "liner" (did you mean "linear"?)']),
    "unknown kinematics": (append('kinematics = "inextensible"\n'), ['did you mean "inextensible_braid"?']),
    "unknown friction": (toml('"coulomb"', '"colomb"'), ['did you mean "coulomb"?']),
    "unknown effect": (
        append('effects = ["dead_bend"]\n'),
        [
            'specimen.toml:17:simulation.effects: found the unknown effect "dead_bend"',
            '(did you mean "dead_band"?)',
        ],
    ),
    "effect twice": (append('effects = ["creep", "creep"]\n'), ["twice"]),
    "unknown moduli": (append('moduli = "loop"\n'), ['"run:PATH"']),
    "run that is not there": (append('moduli = "run:../nothing"\n'), ["which is not there"]),
    "order 0": (
        toml("order = 2", "order = 0"),
        ["specimen.toml:15:simulation.order: found 0, expected a value at or"],
    ),
    "order as a fraction": (
        toml("order = 2", "order = 2.5"),
        ["simulation.order: found 2.5, expected a whole number"],
    ),
    "friction without a braid": (toml('"coulomb"', '"strand"'), ["without a [braid]"]),
    "effect without a braid": (append('effects = ["braid_stretch"]\n'), ["braid_stretch without a [braid]"]),
    "no geometry": (
        lambda f: (f / "specimen.toml").write_text(
            DECLARATION[: DECLARATION.index("[geometry]")] + DECLARATION[DECLARATION.index("[files]") :]
        ),
        ["no table [geometry]"],
    ),
    "no files": (toml('loops = "loops.csv"', ""), ["no data files"]),
    "a list of no files": (
        toml('"loops.csv"', "[]"),
        ["specimen.toml:11:files.loops: found an empty list, expected at least one file's name"],
    ),
    "tensile moduli without a source": (
        append('moduli = "tensile"\n'),
        ["without E_Pa and without a tensile file"],
    ),
    "moduli twice": (
        lambda f: (
            append('moduli = "tensile"\nE_Pa = [4e4]\n')(f),
            toml("[files]", '[files]\ntensile = "t.csv"')(f),
        ),
        ["both E_Pa and a tensile file"],
    ),
    "E_Pa with free moduli": (append("E_Pa = [4e4]\n"), ['E_Pa with moduli = "loops"']),
    "strain range of less than nothing": (
        append("[fit]\ntensile_strain = [-1.5, 0.5]\n"),
        ["[-1.5, 0.5], expected strains above -1"],
    ),
    "strain range upside down": (append("[fit]\ntensile_strain = [3.0, 0.1]\n"), ["[3, 0.1]"]),
    "strain range of one": (
        append("[fit]\ntensile_strain = [0.1]\n"),
        ["specimen.toml:18:fit.tensile_strain: found a list of 1, expected two numbers, from and to"],
    ),
    "strain range of none": (append("[fit]\ntensile_strain = []\n"), ["a list of 0, expected two numbers"]),
    "strain range of three": (
        append("[fit]\ntensile_strain = [0.1, 1.0, 3.0]\n"),
        ["a list of 3, expected two"],
    ),
    "mapped column missing": (
        append('[columns.loops]\nforce_N = "Load"\n'),
        ["loops.csv:1:force_N: ", 'a column "Load" (for force_N)'],
    ),
    "mapped column unknown": (append('[columns.loops]\nforce_n = "Load"\n'), ['did you mean "force_N"?']),
    "mapped scale zero": (append("[columns.loops]\nforce_N = { scale = 0.0 }\n"), ["other than zero"]),
    "delimiter too long": (append('[csv]\ndelimiter = ";;"\n'), ["a single character"]),
}


@pytest.mark.parametrize("name", CASES)
def test_one_line_and_exit_code_2(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    spoil, fragments = CASES[name]
    folder = good(tmp_path / "muscle")
    spoil(folder)
    before = sorted(tmp_path.rglob("*"))
    monkeypatch.setattr(sys, "argv", ["mpam-calib", "check", str(folder)])
    with pytest.raises(SystemExit) as exit_:
        main()
    out, err = capsys.readouterr()
    assert exit_.value.code == 2, err
    assert out == ""
    assert err.startswith("error: ") and err.count("\n") == 1, err
    for fragment in fragments:
        assert fragment in err
    assert ", expected " in err
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize("name", ["text", "syntax"])
def test_as_a_process(name: str, tmp_path: Path) -> None:
    folder = good(tmp_path / "muscle")
    CASES[name][0](folder)
    command = [sys.executable, "-m", "mpam_calib", "check", str(folder / "specimen.toml")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stdout == ""
    assert done.stderr.startswith("error: ") and done.stderr.count("\n") == 1


def test_the_good_folder_is_good(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "argv", ["mpam-calib", "check", str(good(tmp_path))])
    with pytest.raises(SystemExit) as exit_:
        main()
    out, err = capsys.readouterr()
    assert exit_.value.code == 0
    assert err == ""
    assert "loops.csv" in out and "unloading" in out
