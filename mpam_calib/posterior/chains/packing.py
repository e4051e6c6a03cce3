"""The bytes of a part of unfinished work, which only values of this package and plain arrays can be in.

One line of text that seals it, then a zip archive of plain arrays (``.npz``, read without pickle) with a JSON
text that says how they hang together. Reading one can only build dataclasses, named tuples and declarations
of this package.
"""

from __future__ import annotations

import dataclasses
import hashlib
import importlib
import io
import json
import math
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from pydantic import BaseModel

Arrays = dict[str, NDArray[Any]]

HEADER = "mpam-calib checkpoint 3"
TREE = "tree"
PACKAGE = __name__.partition(".")[0]


class Damaged(ValueError):
    """A part that does not hold what its digest says, or that no version of this package wrote."""


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
