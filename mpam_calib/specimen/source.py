"""The data files that a declaration names: where they lie, how they are written, their rows."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import Column, Csv, Declaration, FileKind
from mpam_calib.specimen.repeats import same_content
from mpam_calib.specimen.tables import TABLES, TableSpec
from mpam_calib.specimen.text_format import TextFormat, detect_format
from mpam_calib.specimen.toml_source import TomlSource
from mpam_calib.specimen.validation import fault
from mpam_calib.specimen.wording import os_reason, quoted

if TYPE_CHECKING:
    import pandas as pd

_CHUNK = 1 << 20


@dataclass(frozen=True)
class DataFile:
    """One data file of a specimen; ``label`` is its path as messages show it."""

    kind: FileKind
    name: str
    path: Path
    label: str
    csv: Csv
    mapping: dict[str, Column]

    @property
    def spec(self) -> TableSpec:
        """The columns of its kind."""
        return TABLES[self.kind]

    @cached_property
    def form(self) -> TextFormat:
        """How it is written; the first access opens the file and may raise ``InputError``."""
        return detect_format(self.path, self.label, self.spec, self.csv, self.mapping)

    @property
    def estimated_rows(self) -> float:
        """Number of data rows, from the size of the file and its first rows."""
        return self.path.stat().st_size / self.form.bytes_per_row

    def blocks(self) -> Iterator[pd.DataFrame]:
        """Its rows, block by block; see :func:`mpam_calib.specimen.blocks.read_blocks`."""
        from mpam_calib.specimen.blocks import read_blocks

        return read_blocks(self.path, self.label, self.spec, self.form)

    def whole(self) -> pd.DataFrame:
        """All its rows in one frame, indexed by the editor's row numbers."""
        import pandas as pd

        return pd.concat(list(self.blocks()))


def data_files(source: TomlSource, declaration: Declaration) -> list[DataFile]:
    """Every file that ``[files]`` names; each must exist inside the specimen's folder, once."""
    folder = source.file.parent
    found: dict[Path, DataFile] = {}
    for kind in get_args(FileKind):
        for name in declaration.files.of(kind):
            keys = ["files", kind]
            if "\0" in name:
                raise fault(source, keys, f"{quoted(name)}", "a file's name")
            path = folder / name
            if Path(name).is_absolute() or ".." in Path(name).parts:
                # A copy of the specimen could not have it.
                outside = f"a path from outside the specimen's folder ({quoted(name)})"
                raise fault(source, keys, outside, "one that begins in it")
            if not path.resolve().is_relative_to(folder.resolve()):
                outside = f"a file outside the specimen's folder ({quoted(name)})"
                raise fault(source, keys, outside, "one inside it")
            if path.resolve() in found:
                raise fault(source, keys, f"{quoted(name)} twice", "every file once")
            if not path.exists():
                raise InputError(path, "no such file", f"the {kind} data that {source.file.name} names")
            if path.is_dir():
                raise InputError(path, "a folder", f"the {kind} data as a CSV file")
            mapping = declaration.columns.of(kind)
            found[path.resolve()] = DataFile(kind, name, path, str(path), declaration.csv, mapping)
        _refuse_the_same(source, kind, [file for file in found.values() if file.kind == kind])
    return list(found.values())


def _refuse_the_same(source: TomlSource, kind: FileKind, files: Sequence[DataFile]) -> None:
    """Refuse one recording under two names."""
    if twice := same_content(file.path for file in files):
        first, second = (quoted(next(file.name for file in files if file.path == path)) for path in twice)
        raise fault(
            source, ["files", kind], f"the same content in {first} and {second}", "every reading once"
        )


def refuse_skipped_headers(source: TomlSource, files: Sequence[DataFile]) -> None:
    """Refuse rows to skip that hold the header of every file; where one has it below, they are for it."""
    skipped = source.tables.get("csv", {}).get("skip_rows")
    if skipped is None or not files or any(file.form.header_row > skipped for file in files):
        return
    file = files[0]
    raise fault(
        source,
        ["csv", "skip_rows"],
        f"{skipped}, with the header of {quoted(file.name)} in row {file.form.header_row}",
        f"the number of rows above it ({file.form.header_row - 1})",
    )


def digest(tables: dict[str, Any], files: Sequence[Path]) -> str:
    """SHA-256 over the parsed declaration (comments and layout left out) and the files' bytes."""
    total = hashlib.sha256(json.dumps(tables, sort_keys=True, default=str).encode())
    for path in files:
        try:
            with path.open("rb") as stream:
                part = hashlib.sha256()
                while chunk := stream.read(_CHUNK):
                    part.update(chunk)
        except OSError as error:
            raise InputError(path, os_reason(error), "a file that can be read") from None
        total.update(part.digest())
    return total.hexdigest()
