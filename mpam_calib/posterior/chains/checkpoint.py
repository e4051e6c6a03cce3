"""Parts of unfinished work on disk, written whole or not at all: draws with the states to resume from, fits.

A part is one line of text that seals it, then a zip archive of plain arrays (``.npz``, read without pickle)
with a JSON text that says how they hang together. Reading one can only build dataclasses, named tuples and
declarations of this package.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import io
import json
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import BaseModel

from mpam_calib.errors import Interrupted

Arrays = dict[str, NDArray[Any]]

HEADER = "mpam-calib checkpoint 3"
TREE = "tree"
SUFFIX = ".checkpoint"
UNFINISHED = ".part"
"""Suffix of a file that is being written; a killed process may leave one behind."""
PACKAGE = __name__.partition(".")[0]


class Damaged(ValueError):
    """A part that does not hold what its digest says, or that no version of this package wrote."""


def write_atomically(path: Path, write: Callable[[Path], object]) -> None:
    """Let ``write`` fill a temporary file beside ``path``, then put it in place in one step."""
    path.parent.mkdir(parents=True, exist_ok=True)
    prefix = f".{path.name}.{os.getpid()}."
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=prefix, suffix=UNFINISHED)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        # mkstemp makes files that only their owner reads; results are for sharing.
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def sweep(folder: Path) -> None:
    """Remove the unfinished files that a killed process left in a folder."""
    for path in folder.glob(f".*{UNFINISHED}"):
        if not _being_written(path):
            path.unlink(missing_ok=True)


def _being_written(path: Path) -> bool:
    """Whether another process, whose number is in the file's name, is still there to write it."""
    number = path.name.split(".")[-3]
    if os.name != "posix" or not number.isdigit() or int(number) == os.getpid():
        return False
    try:
        os.kill(int(number), 0)  # sends nothing: asks only
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # another user's
        return True
    return True


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


def pack(part: Any, digest: str) -> bytes:
    """The bytes of a part: a line with the run's digest and the seal, then the archive."""
    store = _Store()
    tree = json.dumps(_encode(part, store))
    stream = io.BytesIO()
    arrays = {TREE: np.frombuffer(tree.encode(), dtype=np.uint8), **store.joined()}
    np.savez(stream, allow_pickle=False, **arrays)
    archive = stream.getvalue()
    return f"{HEADER} {digest} {_seal(digest, archive)}\n".encode() + archive


def unpack(payload: bytes, digest: str) -> Any:
    """What ``pack`` stored; raises ``Damaged`` where anything is amiss or the digest is another."""
    header, _, archive = payload.partition(b"\n")
    if header != f"{HEADER} {digest} {_seal(digest, archive)}".encode():
        raise Damaged("cut, changed, or another run's")
    try:
        with np.load(io.BytesIO(archive), allow_pickle=False) as stored:
            arrays: Arrays = {name: stored[name] for name in stored.files}
        return _decode(json.loads(arrays.pop(TREE).tobytes()), arrays)
    # Whole, but of another version of this package: a class or a field that is no longer there.
    except (KeyError, ValueError, TypeError, AttributeError, ImportError) as error:
        raise Damaged(str(error)) from error


def _seal(digest: str, archive: bytes) -> str:
    return hashlib.sha256(digest.encode() + archive).hexdigest()


class _Store:
    """The arrays of a part, those of one kind end to end: a part may hold thousands of small ones."""

    def __init__(self) -> None:
        self._kinds: dict[str, list[NDArray[Any]]] = {}
        self._lengths: dict[str, int] = {}

    def add(self, array: NDArray[Any]) -> list[Any]:
        """Keep an array; its kind, where it begins, its shape and the order of its elements in memory.

        Products of matrices in another order differ in their last bits.
        """
        kind = array.dtype.str
        order: Literal["C", "F"] = "F" if array.flags.f_contiguous else "C"
        begin = self._lengths.get(kind, 0)
        self._kinds.setdefault(kind, []).append(array.ravel(order))
        self._lengths[kind] = begin + array.size
        return [kind, begin, list(array.shape), order]

    def joined(self) -> Arrays:
        """One array of each kind."""
        return {kind: np.concatenate(parts) for kind, parts in self._kinds.items()}


def _encode(item: Any, store: _Store) -> Any:
    """JSON for ``item``; its arrays go to the ``store``."""
    if item is None or type(item) in (bool, int, float, str):
        return item
    if isinstance(item, np.ndarray | np.generic):
        kept = store.add(np.asarray(item))
        return {"scalar" if isinstance(item, np.generic) else "array": kept}
    if type(item) in (list, tuple):
        return {type(item).__name__: [_encode(value, store) for value in item]}
    if type(item) is frozenset:
        return {"frozenset": [_encode(value, store) for value in sorted(item)]}
    if type(item) is dict and all(type(key) is str for key in item):
        return {"dict": {key: _encode(value, store) for key, value in item.items()}}
    if type(item) is pd.DataFrame:
        columns = {str(name): item[name] for name in item}
        return {"table": {name: [str(c.dtype), _encode(_values(c), store)] for name, c in columns.items()}}
    if type(item).__module__.split(".")[0] == PACKAGE and (names := _fields(type(item))) is not None:
        fields = {name: _encode(getattr(item, name), store) for name in names}
        return {"class": f"{type(item).__module__}:{type(item).__qualname__}", "fields": fields}
    raise TypeError(f"a checkpoint cannot hold {type(item).__qualname__}")


def _values(column: pd.Series[Any]) -> NDArray[Any] | list[Any]:
    """A table's column: an array, or a list where it holds texts, things of several kinds or nothing."""
    values = column.to_numpy()
    return values.tolist() if values.dtype == object else values


def _fields(kind: type[Any]) -> list[str] | None:
    """The fields of a dataclass, a named tuple or a declaration; None of anything else."""
    if dataclasses.is_dataclass(kind):
        return [f.name for f in dataclasses.fields(kind)]
    if issubclass(kind, tuple) and hasattr(kind, "_fields"):
        return list(kind._fields)
    return list(kind.model_fields) if issubclass(kind, BaseModel) else None


def _decode(tree: Any, arrays: Arrays) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "class" in tree:
        return _class(tree["class"])(**{k: _decode(v, arrays) for k, v in tree["fields"].items()})
    ((kind, content),) = tree.items()
    match kind:
        case "array":
            return _cut(content, arrays)
        case "scalar":
            return _cut(content, arrays)[()]
        case "list":
            return [_decode(value, arrays) for value in content]
        case "tuple":
            return tuple(_decode(value, arrays) for value in content)
        case "frozenset":
            return frozenset(_decode(value, arrays) for value in content)
        case "table":
            return pd.DataFrame(
                {key: pd.Series(_decode(v, arrays), dtype=kind) for key, (kind, v) in content.items()}
            )
        case "dict":
            return {key: _decode(value, arrays) for key, value in content.items()}
        case _:
            raise Damaged(f"unknown kind {kind}")


def _cut(kept: list[Any], arrays: Arrays) -> NDArray[Any]:
    """One of the arrays that lie end to end."""
    kind, begin, shape, order = kept
    return arrays[kind][begin : begin + math.prod(shape)].reshape(shape, order=order)


def _class(name: str) -> type[Any]:
    """A dataclass, named tuple or declaration of this package by its name; nothing else can be asked for."""
    module, _, qualname = name.partition(":")
    if module.split(".")[0] != PACKAGE:
        raise Damaged(f"a class from elsewhere: {module}")
    found = getattr(importlib.import_module(module), qualname)
    if not isinstance(found, type) or _fields(found) is None:
        raise Damaged(f"no class of values: {name}")
    return found
