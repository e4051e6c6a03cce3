"""Blocks of draws on disk: written whole or not at all, each with the states to resume from."""

from __future__ import annotations

import os
import pickle
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

FORMAT = 1


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then put it in place in one step."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        # mkstemp makes files that only their owner reads; results are for sharing.
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


@dataclass(frozen=True)
class Checkpoint:
    """A folder of numbered parts that belong to one digest of data, model and options."""

    folder: Path
    digest: str

    def save(self, name: str, part: Any) -> None:
        """Store one part under a name."""
        payload = pickle.dumps((FORMAT, self.digest, part), protocol=5)
        write_atomically(self.folder / f"{name}.pickle", lambda path: path.write_bytes(payload))

    def load(self, name: str) -> Any | None:
        """A part stored under this name and digest, or None; a damaged part counts as missing."""
        try:
            form, digest, part = pickle.loads((self.folder / f"{name}.pickle").read_bytes())
        except (OSError, pickle.UnpicklingError, EOFError, ValueError, TypeError, AttributeError):
            return None
        return part if (form, digest) == (FORMAT, self.digest) else None

    def clear(self) -> None:
        """Remove all parts."""
        shutil.rmtree(self.folder, ignore_errors=True)
