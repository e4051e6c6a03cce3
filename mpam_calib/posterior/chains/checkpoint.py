"""Parts of unfinished work on disk: draws with the states to resume from, fits."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mpam_calib.atomic_files import sweep, write_atomically
from mpam_calib.errors import Interrupted
from mpam_calib.posterior.chains.packing import HEADER, Damaged, pack, unpack

SUFFIX = ".checkpoint"


@dataclass(frozen=True)
class Checkpoint:
    """A folder of named parts that belong to one digest of data, model and options."""

    folder: Path
    digest: str

    def save(self, name: str, part: Any) -> None:
        """Store one part under a name: numbers, texts, arrays, tables, values of this package, lists."""
        payload = pack(part, self.digest)
        write_atomically(self._path(name), lambda path: path.write_bytes(payload))

    def load(self, name: str) -> Any | None:
        """A part stored under this name and digest, or None; a damaged part counts as missing."""
        try:
            return unpack(self._path(name).read_bytes(), self.digest)
        except (OSError, Damaged):
            return None

    def clear(self) -> None:
        """Remove all parts, whatever their digest, and the folder where nothing else is in it."""
        for path in self.folder.glob(f"*{SUFFIX}"):
            path.unlink(missing_ok=True)
        sweep(self.folder)
        with suppress(OSError):
            self.folder.rmdir()

    @property
    def begun(self) -> bool:
        """Whether there is a part of this digest."""
        return any(self._is_own(path) for path in self.folder.glob(f"*{SUFFIX}"))

    @contextmanager
    def resumable(self) -> Iterator[None]:
        """Whoever stops the work inside by Ctrl-C is told by ``Interrupted`` whether something is kept."""
        try:
            yield
        except KeyboardInterrupt as error:
            if not self.begun:
                raise Interrupted("interrupted: nothing was done yet") from error
            raise Interrupted(
                "interrupted: what was done is kept, the same command goes on from it"
            ) from error

    def _is_own(self, path: Path) -> bool:
        with path.open("rb") as part:
            return part.readline().startswith(f"{HEADER} {self.digest} ".encode())

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}{SUFFIX}"
