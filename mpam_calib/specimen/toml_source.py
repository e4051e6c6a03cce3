"""The text of ``specimen.toml``: read, parsed, and where in it each key stands."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpam_calib.errors import InputError
from mpam_calib.specimen.wording import one_line, os_reason

SPECIMEN_FILE = "specimen.toml"

_HEADER = re.compile(r"\s*\[\[?\s*([^\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""\s*(?:"([^"]*)"|'([^']*)'|([A-Za-z0-9_.\-]+))\s*=""")
_POSITION = re.compile(r"\s*\(at line (\d+), column (\d+)\)$")


@dataclass(frozen=True)
class TomlSource:
    """A declaration before validation: its file, its lines and its parsed tables."""

    file: Path
    lines: tuple[str, ...]
    tables: dict[str, Any]

    def line_of(self, keys: Sequence[str | int]) -> int | None:
        """Line (from 1) of the key ``("geometry", "L0_mm")`` or of the nearest table above it."""
        wanted = [key for key in keys if isinstance(key, str)]
        while wanted:
            for number, path in self._paths():
                if path == wanted:
                    return number
            wanted.pop()
        return None

    def _paths(self) -> list[tuple[int, list[str]]]:
        found: list[tuple[int, list[str]]] = []
        table: list[str] = []
        for number, line in enumerate(self.lines, start=1):
            if header := _HEADER.match(line):
                table = [part.strip(" \"'") for part in header[1].split(".")]
                found.append((number, table))
            elif key := _KEY.match(line):
                plain = key[1] or key[2]
                found.append((number, table + ([plain] if plain else key[3].split("."))))
        return found


def declaration_of(path: Path) -> Path:
    """The declaration that is meant by a specimen's folder, or by the file itself."""
    return path / SPECIMEN_FILE if path.is_dir() else path


def read_toml(path: Path) -> TomlSource:
    """Read a declaration; ``path`` is the specimen's folder or the file itself.

    Raises ``InputError`` where it is missing, is not UTF-8 text, or breaks TOML's rules.
    """
    file = declaration_of(path)
    expected = f"a specimen folder with its {SPECIMEN_FILE}"
    if file.is_file() and file.suffix.lower() == ".csv":
        raise InputError(file, "a data file", expected)
    try:
        raw = file.read_bytes()
    except OSError as error:
        raise InputError(file, os_reason(error), expected) from None
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        what = "UTF-16 text" if raw[:2] in (b"\xff\xfe", b"\xfe\xff") else "bytes that are not text"
        raise InputError(file, what, "a TOML file in UTF-8") from None
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        position = _POSITION.search(message)
        found = one_line(_POSITION.sub("", message)) if position else one_line(message)
        raise InputError(
            file,
            f"a TOML syntax error ({found[:1].lower()}{found[1:]})",
            'lines such as L0_mm = 50.0 or name = "MPAM1"',
            row=int(position[1]) if position else None,
        ) from None
    return TomlSource(file, tuple(text.splitlines()), tables)
