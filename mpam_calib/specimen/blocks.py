"""A data file of any size, read in blocks of whole rows, each checked before it is handed on."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.specimen.misread import COMPARED, cut_off
from mpam_calib.specimen.recording import BRANCH_WORDS
from mpam_calib.specimen.tables import EMPTY, GAPPED_COLUMNS, TEXT_COLUMNS, TableSpec
from mpam_calib.specimen.text_format import TextFormat, is_number, refuse_other_than_text
from mpam_calib.specimen.wording import did_you_mean, listed, quoted

BLOCK_BYTES = 1 << 22
"""Read at once: large enough for speed, small enough that memory does not depend on the file."""

_NEWLINE, _QUOTE = 10, 34


@dataclass(frozen=True)
class _Lines:
    """The rows of one block: their bytes (each ended by a newline) and their numbers in an editor."""

    raw: bytes
    rows: NDArray[np.int64]
    open_end: bool = False
    """Whether it is the file's last row, without an end of its own."""


def read_blocks(path: Path, label: str, spec: TableSpec, form: TextFormat) -> Iterator[pd.DataFrame]:
    """Yield the data rows of ``path`` block by block.

    Each frame has one float column per column found (``branch`` as integer codes), in the units of
    the column's name, and the editor's row numbers as its index. Raises ``InputError`` for the
    first row or cell that cannot be used, and for a file with a header only.
    """
    any_row = False
    above: list[bytes] = []
    for lines in _row_blocks(path, label, form):
        _check_row_lengths(label, lines, form)
        if lines.open_end:
            _refuse_cut_off(label, lines, above, form)
        above = lines.raw.split(b"\n")[-COMPARED - 1 : -1]
        frame, form = _parse(label, lines, form)
        for field in form.fields:
            if field.name not in TEXT_COLUMNS and (field.scale, field.offset) != (1.0, 0.0):
                frame[field.name] = frame[field.name] * field.scale + field.offset
        spec.check(frame, label)
        any_row = True
        yield frame
    if not any_row:
        raise InputError(label, "a header and no rows", "at least one row of data")


def _row_blocks(path: Path, label: str, form: TextFormat) -> Iterator[_Lines]:
    rest = b""
    row = 0  # rows before the block
    with path.open("rb") as stream:
        while True:
            piece = stream.read(BLOCK_BYTES)
            if form.carriage_returns_only:
                piece = piece.replace(b"\r", b"\n")
            raw = rest + piece
            if not raw:
                return
            if piece:
                cut = raw.rfind(b"\n") + 1
                raw, rest = raw[:cut], raw[cut:]
                if not raw:
                    continue
            else:
                raw, rest = raw + b"\n", b""
            refuse_other_than_text(label, raw)
            count = raw.count(b"\n")
            lines = _without_blank_rows(raw, row, form.rows_above - row, form)
            row += count
            if len(lines.rows):
                yield replace(lines, open_end=not piece)
            if not piece:
                return


def _without_blank_rows(raw: bytes, before: int, skip: int, form: TextFormat) -> _Lines:
    """Drop the first ``skip`` rows and every blank one; ``before`` rows came earlier in the file.

    A spreadsheet writes a blank row as its delimiters alone.
    """
    data = np.frombuffer(raw, np.uint8)
    ends = np.flatnonzero(data == _NEWLINE)
    rows = before + 1 + np.arange(len(ends), dtype=np.int64)
    if skip > 0:
        skip = min(skip, len(ends))
        raw = raw[ends[skip - 1] + 1 :] if skip else raw
        rows = rows[skip:]
        ends = ends[skip:] - (len(data) - len(raw))
    lengths = np.diff(ends, prepend=-1) - 1
    blank = b" \t\r" + form.delimiter.encode()
    # Only short rows can be blank, unless padded with spaces.
    if len(lengths) and lengths.min() < form.cells + 3:
        kept = raw.split(b"\n")[:-1]
        full = np.array([bool(line.strip(blank)) for line in kept])
        if not full.all():
            raw = b"".join(line + b"\n" for line, whole in zip(kept, full, strict=True) if whole)
            rows = rows[full]
    return _Lines(raw, rows)


def _refuse_cut_off(label: str, lines: _Lines, above: list[bytes], form: TextFormat) -> None:
    """Refuse a last row whose last cell is shorter than it should be, where that is a column that is read."""
    last = [field for field in form.fields if field.position == form.cells - 1]
    mark = form.delimiter.encode()
    cell, *cells = (
        row.rpartition(mark)[2].strip(b' \t\r"').decode(form.encoding, "replace")
        for row in [lines.raw.rstrip(b"\n"), *above]
    )
    if last and last[0].name not in TEXT_COLUMNS and cut_off(cells, cell):
        found = f"{quoted(cell)} at the file's end, shorter than the cells above it (cut off?)"
        raise InputError(label, found, "a whole row", int(lines.rows[-1]), last[0].name)


def _check_row_lengths(label: str, lines: _Lines, form: TextFormat) -> None:
    data = np.frombuffer(lines.raw, np.uint8)
    ends = np.flatnonzero(data == _NEWLINE)
    marks = np.flatnonzero(data == ord(form.delimiter))
    if b'"' in lines.raw:  # a delimiter between quotes does not part cells
        inside = np.cumsum(data == _QUOTE, dtype=np.uint8) & 1
        line_of_mark = np.searchsorted(ends, marks)
        at_start = np.concatenate([[0], inside[ends[:-1]]])
        marks = marks[inside[marks] == at_start[line_of_mark]]
    cells = np.diff(np.searchsorted(marks, ends), prepend=0) + 1
    wrong = np.flatnonzero(cells != form.cells)
    if len(wrong):
        first = wrong[0]
        hint = ""
        if form.delimiter == "," and cells[first] > form.cells:
            hint = " (decimal commas need another delimiter between cells)"
        raise InputError(
            label,
            f"a row of {cells[first]} cell{'s' if cells[first] > 1 else ''}",
            f"{form.cells} cells as in the header{hint}",
            int(lines.rows[first]),
        )


def _parse(label: str, lines: _Lines, form: TextFormat) -> tuple[pd.DataFrame, TextFormat]:
    """The block as numbers and branch codes, and the format as known after it."""
    try:
        frame = _frame(lines.raw, form, text=False)
    except (ValueError, pd.errors.ParserError):
        row, name, cell = _first_bad_cell(label, lines, form)
        if not form.decimal_seen and is_number(cell, ","):
            return _parse(label, lines, replace(form, decimal=",", decimal_seen=True))
        raise _bad_cell(label, row, name, cell, form) from None
    _check_count(label, lines, frame)
    frame.index = pd.Index(lines.rows)
    for name in TEXT_COLUMNS.intersection(frame.columns):
        frame[name] = _branch_codes(label, frame[name])
    if not form.decimal_seen:
        numbers = frame.to_numpy(dtype=float)
        form = replace(form, decimal_seen=bool((numbers != np.round(numbers)).any()))
    return frame, form


def _frame(raw: bytes, form: TextFormat, *, text: bool) -> pd.DataFrame:
    fields = sorted(form.fields, key=lambda field: field.position)
    types: dict[str, str] = {
        str(field.position): "str" if text else ("category" if field.name in TEXT_COLUMNS else "float64")
        for field in fields
    }
    gapped = {
        str(field.position): list(EMPTY) for field in fields if field.name in GAPPED_COLUMNS and not text
    }
    frame: pd.DataFrame = pd.read_csv(
        io.BytesIO(raw),
        sep=form.delimiter,
        decimal=form.decimal,
        header=None,
        names=list(map(str, range(form.cells))),
        usecols=list(types),
        dtype=types,
        keep_default_na=False,
        na_values=gapped,
        na_filter=bool(gapped),
        skipinitialspace=True,
        index_col=False,
        encoding=form.encoding,
        encoding_errors="replace",
        engine="c",
    )
    # One column of the rig may be mapped to several of the package's.
    return pd.DataFrame({field.name: frame[str(field.position)] for field in fields})


def _check_count(label: str, lines: _Lines, frame: pd.DataFrame) -> None:
    if len(frame) != len(lines.rows):
        raise _open_quote(label, lines)


def _open_quote(label: str, lines: _Lines) -> InputError:
    """A quotation mark that is never closed swallows the rows after it."""
    odd = [line.count(b'"') % 2 for line in lines.raw.split(b"\n")]
    row = int(lines.rows[odd.index(1)]) if 1 in odd else None
    return InputError(label, "an unbalanced quotation mark", "cells on one row each", row)


def _first_bad_cell(label: str, lines: _Lines, form: TextFormat) -> tuple[int, str, str]:
    try:
        frame = _frame(lines.raw, form, text=True)
    except pd.errors.ParserError:
        raise _open_quote(label, lines) from None
    _check_count(label, lines, frame)
    mark = "[.]" if form.decimal == "." else ","
    number = rf"\s*[+-]?(?:\d+(?:{mark}\d*)?|{mark}\d+)(?:[eE][+-]?\d+)?\s*|\s*[+-]?inf(?:inity)?\s*"
    numeric = [name for name in frame.columns if name not in TEXT_COLUMNS]
    good = np.column_stack([frame[name].str.fullmatch(number, case=False).to_numpy(bool) for name in numeric])
    for name in GAPPED_COLUMNS.intersection(numeric):
        good[:, numeric.index(name)] |= frame[name].str.lstrip().isin(EMPTY).to_numpy()
    wrong = np.argwhere(~good)
    if not len(wrong):
        raise InputError(
            label, "rows that cannot be parsed", "numbers parted by delimiters", int(lines.rows[0])
        )
    row, column = wrong[0]
    return int(lines.rows[row]), numeric[column], str(frame[numeric[column]].iloc[row])


def _bad_cell(label: str, row: int, name: str, cell: str, form: TextFormat) -> InputError:
    other = "," if form.decimal == "." else "."
    if not cell.strip():
        return InputError(label, "an empty cell", "a number", row, name)
    if cell.strip() == name:
        expected = "a number (a list in [files] where a logger was started anew)"
        return InputError(label, f"{quoted(cell)}, the header again", expected, row, name)
    if is_number(cell, other):
        expected = f'a number with the decimal mark "{form.decimal}" of the rest (mixed decimal marks)'
        return InputError(label, quoted(cell), expected, row, name)
    if name == "time_s" and re.fullmatch(r".*\d:\d\d.*", cell):
        return InputError(label, f"{quoted(cell)} (a clock time?)", "seconds", row, name)
    return InputError(label, quoted(cell), "a number", row, name)


def _branch_codes(label: str, words: pd.Series[str]) -> NDArray[np.int64]:
    categories = [str(word) for word in words.cat.categories]
    codes = [BRANCH_WORDS.get(word.strip().lower()) for word in categories]
    numbers = words.cat.codes.to_numpy()
    unknown = np.isin(numbers, [i for i, code in enumerate(codes) if code is None])
    if unknown.any():
        first = int(np.flatnonzero(unknown)[0])
        word = categories[numbers[first]]
        known = [each for each in BRANCH_WORDS if each]
        found = f"the unknown word {quoted(word)}{did_you_mean(word, known)}"
        raise InputError(label, found, f"one of {listed(known)}", int(words.index[first]), "branch")
    return np.array([code or 0 for code in codes], dtype=np.int64)[numbers]
