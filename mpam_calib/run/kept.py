"""Finished results of the same data, model and options are kept: a mark beside them says whose they are."""

from __future__ import annotations

import hashlib
import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from mpam_calib.posterior.chains.checkpoint import Checkpoint
from mpam_calib.run.files import KEPT_FILE, UNFINISHED, write_json


def written_over(file: Path) -> bool:
    """Whether a file is what a command of this module left beside it, and no calibration's."""
    try:
        content = json.loads((file.parent / KEPT_FILE).read_text(encoding="utf-8"))
        return bool(content["files"].get(file.name) == _sum(file))
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return False


def _sum(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


@dataclass(frozen=True)
class Kept:
    """The ``files`` that a command leaves in a folder, and the digest of what they come from."""

    folder: Path
    command: str
    digest: str
    files: tuple[str, ...]

    def finished(self) -> bool:
        """Whether all of them are there as they were written; nothing is unfinished then."""
        try:
            content = json.loads((self.folder / KEPT_FILE).read_text(encoding="utf-8"))
            done = bool(content == self._content())
        except (OSError, ValueError):
            return False
        if done:
            self._tidy()
        return done

    @property
    def unfinished(self) -> Checkpoint:
        """Where the command keeps what it has while it is not done."""
        return Checkpoint(self.folder / UNFINISHED / f"{self.command}_{self.digest[:16]}", self.digest)

    def begin(self) -> None:
        """Take an older mark away before anything is replaced."""
        (self.folder / KEPT_FILE).unlink(missing_ok=True)

    def finish(self) -> None:
        """Mark the files as finished."""
        write_json(self._content(), self.folder / KEPT_FILE)
        self._tidy()

    def _tidy(self) -> None:
        """Remove what this command left unfinished here, and the folder where no other did."""
        with suppress(OSError):  # what is kept may be where nothing may be written
            for path in (self.folder / UNFINISHED).glob(f"{self.command}_*"):
                Checkpoint(path, self.digest).clear()
            (self.folder / UNFINISHED).rmdir()

    def _content(self) -> dict[str, object]:
        return {"digest": self.digest, "files": {name: _sum(self.folder / name) for name in self.files}}
