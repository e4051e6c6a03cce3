"""Finished results of the same data, model and options are kept: a mark beside them says whose they are."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

from mpam_calib.run.files import write_json

MARK = "kept.json"
"""Written last; holds the digest, and that of every file, since another command may write the same names."""


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

    def begin(self) -> None:
        """Take an older mark away before anything is replaced."""
        (self.folder / MARK).unlink(missing_ok=True)

    def finish(self) -> None:
        """Mark the files as finished."""
        write_json(self._content(), self.folder / MARK)

    def _content(self) -> dict[str, object]:
        sums = {name: hashlib.sha256((self.folder / name).read_bytes()).hexdigest() for name in self.files}
        return {"digest": self.digest, "files": sums}
