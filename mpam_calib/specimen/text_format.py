"""How a rig's text file is written: encoding, line ends, delimiter, decimal mark, header row."""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import Column, Csv
from mpam_calib.specimen.misread import refuse_thousands
from mpam_calib.specimen.own_names import means_how_many, refuse_missing, written_names
from mpam_calib.specimen.tables import TEXT_COLUMNS, TableSpec
from mpam_calib.specimen.units_row import are_units, check_header_units, is_units_row
from mpam_calib.specimen.wording import listed, os_reason, quoted

SAMPLE_BYTES = 1 << 17
HEADER_ROWS = 64
"""A header is looked for in this many first rows."""

_DELIMITERS = (";", "\t", ",")
_UTF16_MARKS = (b"\xff\xfe", b"\xfe\xff")
_CONTROL = bytes(set(range(32)) - {9, 10, 11, 12, 13, 27})
_MARK = {
    mark: re.compile(rf"[+-]?(?:\d*[{mark}]\d+|\d+[{mark}])(?:[eE][+-]?\d+)?") for mark in ".,"
}  # fmt: skip


@dataclass(frozen=True)
class Field:
    """Where a column stands in the file, and the factor and offset that its cells take."""

    name: str
    position: int
    scale: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class TextFormat:
    """How one file is written: its header in row ``header_row``, its data below ``rows_above`` rows.

    ``decimal_seen`` is false while no cell has shown a decimal mark yet.
    """

    encoding: str
    carriage_returns_only: bool
    delimiter: str
    decimal: str
    decimal_seen: bool
    header_row: int
    rows_above: int
    cells: int
    fields: tuple[Field, ...]
    bytes_per_row: float
    overlooked: tuple[tuple[str, str], ...] = ()
    """Columns that are not read, and the optional ones that they are but for their spelling."""


def detect_format(
    path: Path, label: str, spec: TableSpec, declared: Csv, mapping: dict[str, Column]
) -> TextFormat:
    """Read the beginning of ``path`` and settle how it is written.

    ``label`` is the file's name in messages. Raises ``InputError`` for a missing, empty, binary
    or UTF-16 file, a header without the required columns, or one that names a column twice, and for
    units below it that are not the columns' own.
    """
    try:
        with path.open("rb") as stream:
            sample = stream.read(SAMPLE_BYTES)
    except OSError as error:
        raise InputError(label, os_reason(error), "a CSV file") from None
    refuse_other_than_text(label, sample)
    carriage_returns_only = b"\n" not in sample and b"\r" in sample
    encoding = _encoding(sample)
    text = sample.decode(encoding, errors="replace").removeprefix("\ufeff")
    lines = text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    if len(sample) == SAMPLE_BYTES and len(lines) > 1:
        lines.pop()  # cut off in the middle
    if not any(line.strip() for line in lines):
        raise InputError(label, "an empty file", f"a header with {listed(spec.required)} and rows below it")
    wanted = written_names(spec, mapping)
    row, delimiter = _header(lines, declared, spec, set(wanted.values()))
    header = _split(lines[row], delimiter)
    fields = _fields(label, row + 1, header, spec, mapping, wanted)
    check_header_units(label, row + 1, header, fields)
    body = [line for line in lines[row + 1 :] if line.strip()]
    above = row + 1
    if body:
        below = lines.index(body[0], above) + 1
        if is_units_row(label, below, _split(body[0], delimiter), fields):
            above, body = below, body[1:]
    numbers = [field for field in fields if field.name not in TEXT_COLUMNS]
    mark = declared.decimal or _decimal(body, delimiter, [field.position for field in numbers])
    parted = [(below, _split(line, delimiter)) for below, line in enumerate(lines[above:], above + 1)]
    for field in numbers:
        place = field.position
        refuse_thousands(
            label, field.name, [(below, cells[place]) for below, cells in parted if place < len(cells)]
        )
    width = sum(map(len, body)) / len(body) + 1.0 if body else 1.0
    return TextFormat(
        encoding,
        carriage_returns_only,
        delimiter,
        mark or ".",
        mark is not None,
        row + 1,
        above,
        len(header),
        fields,
        width,
        _overlooked(header, spec, wanted),
    )


def is_number(cell: str, decimal: str) -> bool:
    """Whether ``cell`` is a number written with this decimal mark (or with none).

    >>> is_number("-1,5e3", ","), is_number("1.5", ","), is_number("7", ",")
    (True, False, True)
    """
    plain = cell.strip()
    return bool(re.fullmatch(r"[+-]?\d+(?:[eE][+-]?\d+)?", plain) or _MARK[decimal].fullmatch(plain))


def refuse_other_than_text(label: str, raw: bytes) -> None:
    """Raise ``InputError`` where ``raw`` is UTF-16 or binary."""
    expected = "a CSV file in UTF-8"
    if raw[:2] in _UTF16_MARKS or _every_second_is_zero(raw[:512]):
        raise InputError(label, "UTF-16 text", expected)
    if len(raw.translate(None, _CONTROL)) != len(raw):
        raise InputError(label, "a binary file", expected)


def _every_second_is_zero(raw: bytes) -> bool:
    """Whether ``raw`` looks like Latin text in UTF-16 without its mark."""
    half = len(raw) // 2
    zeros = sorted([raw[::2].count(0), raw[1::2].count(0)])
    return half > 1 and zeros[0] == 0 and zeros[1] > 0.8 * half


def _encoding(sample: bytes) -> str:
    """UTF-8, or Windows' Western code page where the bytes are not UTF-8 (a degree sign, say)."""
    try:
        sample[: len(sample) - 4].decode("utf-8")  # the last character may be cut
    except UnicodeDecodeError as error:
        return "utf-8" if error.reason == "unexpected end of data" else "cp1252"
    return "utf-8"


def _split(line: str, delimiter: str) -> list[str]:
    rows = list(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    return [cell.strip() for cell in rows[0]] if rows else []


def _header(lines: Sequence[str], declared: Csv, spec: TableSpec, wanted: set[str]) -> tuple[int, str]:
    """The row (from 0) and delimiter that find most of the wanted names; else what is most like a header."""
    delimiters = (declared.delimiter,) if declared.delimiter else _DELIMITERS
    first = declared.skip_rows or 0
    filled = [row for row, line in enumerate(lines) if line.strip()]
    rows = [row for row in filled if row >= first] or filled[-1:]
    lower = {name.lower() for name in wanted}

    def merit(choice: tuple[int, str]) -> tuple[int, int, int, int]:
        cells = _split(lines[choice[0]], choice[1])
        found = len(lower.intersection(map(str.lower, cells)))
        return found, 0 if found else means_how_many(spec, cells), -choice[0], len(cells)

    def best(rows: Sequence[int]) -> tuple[int, str]:
        return max(((row, delimiter) for row in rows for delimiter in delimiters), key=merit)

    if declared.skip_rows is None:
        found = best(rows[:HEADER_ROWS])
        if any(merit(found)[:2]):
            return found
        return _above_numbers(lines, rows[:HEADER_ROWS], delimiters) or found
    # Where the row holds none of the names, the declaration was meant for another file of the specimen.
    found, elsewhere = best(rows[:1]), best(filled[:HEADER_ROWS])
    return elsewhere if merit(found)[0] == 0 < merit(elsewhere)[0] else found


def _above_numbers(
    lines: Sequence[str], rows: Sequence[int], delimiters: Sequence[str]
) -> tuple[int, str] | None:
    """The last row of words that are no units above the first row of numbers, and the delimiter of both."""
    for end, row in enumerate(rows):
        for delimiter in delimiters:
            if _all_numbers(_split(lines[row], delimiter)):
                above = [each for each in rows[:end] if not are_units(_split(lines[each], delimiter))]
                return (above[-1], delimiter) if above else None
    return None


def _all_numbers(cells: Sequence[str]) -> bool:
    """Whether several cells, some perhaps empty, are numbers with either decimal mark."""
    filled = [cell for cell in cells if cell]
    return len(filled) > 1 and all(any(is_number(cell, mark) for mark in _MARK) for cell in filled)


def _fields(
    label: str,
    header_row: int,
    header: Sequence[str],
    spec: TableSpec,
    mapping: dict[str, Column],
    wanted: dict[str, str],
) -> tuple[Field, ...]:
    refuse_missing(label, header_row, header, spec, mapping)
    fields = []
    for name, written in wanted.items():
        if written not in header:
            continue
        if header.count(written) > 1:
            raise InputError(label, f"{quoted(written)} twice", "each column once", header_row, name)
        column = mapping.get(name, Column())
        fields.append(Field(name, header.index(written), column.scale, column.offset))
    return tuple(fields)


def _overlooked(
    header: Sequence[str], spec: TableSpec, wanted: dict[str, str]
) -> tuple[tuple[str, str], ...]:
    """Columns of the header that are optional ones written otherwise (``Branch``), with these."""

    def plain(name: str) -> str:
        return re.sub(r"[\W_]", "", name).lower()

    missed = {plain(name): name for name in spec.optional if wanted[name] == name and name not in header}
    read = set(wanted.values())
    return tuple((cell, missed[plain(cell)]) for cell in header if plain(cell) in missed and cell not in read)


def _decimal(body: Sequence[str], delimiter: str, positions: Sequence[int]) -> str | None:
    """The first decimal mark that a number column shows, or None."""
    for cells in csv.reader(body, delimiter=delimiter, skipinitialspace=True):
        for position in positions:
            if position < len(cells):
                for mark, pattern in _MARK.items():
                    if pattern.fullmatch(cells[position].strip()):
                        return mark
    return None
