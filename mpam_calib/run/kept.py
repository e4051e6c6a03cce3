"""Finished results of the same data, model and options are kept: a mark beside them says whose they are."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from mpam_calib.posterior.checkpoint import Checkpoint
from mpam_calib.run.files import write_json

UNFINISHED = "unfinished"
MARK = "kept.json"
"""Written last; holds the digest, and that of every file, since another command may write the same names."""


def written_over(file: Path) -> bool:
    """Whether a file is what a command of this module left beside it, and no calibration's."""
    try:
        content = json.loads((file.parent / MARK).read_text(encoding="utf-8"))
        return bool(content["files"].get(file.name) == _sum(file))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def _sum(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@dataclass(frozen=True)
class Kept:
    """The ``files`` that a command leaves in a folder, and the digest of what they come from."""

    folder: Path
    digest: str
    files: tuple[str, ...]

    def finished(self) -> bool:
        """Whether all of them are there as they were written."""
        try:
            content = json.loads((self.folder / MARK).read_text(encoding="utf-8"))
            return bool(content == self._content())
        except (OSError, ValueError):
            return False

    @property
    def unfinished(self) -> Checkpoint:
        """Where a command that is not done keeps what it has."""
        return Checkpoint(self.folder / UNFINISHED, self.digest)

    def begin(self) -> None:
        """Take an older mark away before anything is replaced."""
        (self.folder / MARK).unlink(missing_ok=True)

    def finish(self) -> None:
        """Mark the files as finished."""
        write_json(self._content(), self.folder / MARK)
        self.unfinished.clear()

    def _content(self) -> dict[str, object]:
        return {"digest": self.digest, "files": {name: _sum(self.folder / name) for name in self.files}}
