"""The package's exceptions: one tree, whose messages carry the place and the value."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


class MpamError(Exception):
    """Base of every error that says what is wrong in files, options and data."""


@dataclass
class InputError(MpamError):
    """Something the user gave cannot be used: where it stands, what was found, what was expected.

    ``str(error)`` is ``FILE[:ROW][:COLUMN]: found, expected ...``; rows are counted as in a text
    editor (the header is row 1).
    """

    file: str | Path
    found: str
    expected: str
    row: int | None = None
    column: str | None = None

    def __str__(self) -> str:
        place = [str(self.file)]
        if self.row is not None:
            place.append(str(self.row))
        if self.column is not None:
            place.append(self.column)
        return f"{':'.join(place)}: found {self.found}, expected {self.expected}"


class Interrupted(MpamError):
    """The user stopped a long computation; what was drawn is on disk and can be resumed."""
