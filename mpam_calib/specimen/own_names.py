"""A rig's own column names: which of the package's are missing, and the map that would give them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Final

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import Column
from mpam_calib.specimen.tables import TABLES, TableSpec
from mpam_calib.specimen.units_row import worth
from mpam_calib.specimen.wording import did_you_mean, listed, quoted

_FIRST_WORDS: Final = {
    "time_s": ("time",),
    "pressure_kPa": ("pressure",),
    "displacement_mm": ("displacement",),
    "force_N": ("force", "load"),
    "contraction": ("contraction",),
    "strain": ("strain",),
    "stress_Pa": ("stress",),
}
"""First words of the names that mean a column; an extension or a position would have another sign or zero."""

_WORD_AND_UNIT: Final = re.compile(r"(?P<word>[^\W\d_]+)[\s_]*[\[(/]?\s*(?P<unit>[^\[\]()]*?)\s*[\])]?\s*")


def written_names(spec: TableSpec, mapping: Mapping[str, Column]) -> dict[str, str]:
    """How a file writes the names of a table's columns: as they are mapped, else as they are."""
    return {name: mapping[name].name or name if name in mapping else name for name in spec.columns}


def refuse_missing(
    label: str, row: int, header: Sequence[str], spec: TableSpec, mapping: Mapping[str, Column]
) -> None:
    """Raise ``InputError`` (``row`` is the header's) unless all required and all mapped columns are there."""
    wanted = written_names(spec, mapping)
    missing = [
        name
        for name, written in wanted.items()
        if written not in header and (name in spec.required or name in mapping)
    ]
    if not missing:
        return
    cells = [cell for cell in header if cell]
    found = f"the columns {listed(cells)}"
    for name in missing:
        if wanted[name] != name:  # a slip in the declaration
            found += did_you_mean(wanted[name], cells)
            raise InputError(label, found, f"a column {quoted(wanted[name])} (for {name})", row, name)
    several = len(missing) > 1
    if not several:  # a slip in the file
        found += did_you_mean(missing[0], cells)
    expected = f"the columns {listed(missing)}" if several else f"a column {quoted(missing[0])}"
    free = [cell for cell in cells if cell not in wanted.values()]
    kind = next(kind for kind, each in TABLES.items() if each is spec)
    if map_ := ", ".join(filter(None, (_entry(name, free) for name in missing))):
        expected += f", or in specimen.toml [columns.{kind}] {map_}"
    else:
        expected += f" (or [columns] that say how {'they are' if several else 'it is'} called)"
    raise InputError(label, found, expected, row, missing[0])


def means_how_many(spec: TableSpec, header: Sequence[str]) -> int:
    """How many of a file's columns the header's names can mean."""
    return sum(any(_means(name, cell) is not None for cell in header) for name in spec.columns)


def _entry(name: str, cells: Sequence[str]) -> str:
    """A line of the map for a column, where one cell of the header alone can mean it; else nothing."""
    found = [(cell, factor) for cell in cells if (factor := _means(name, cell)) is not None]
    if len(found) != 1:
        return ""
    cell, factor = found[0]
    return f"{name} = " + (quoted(cell) if factor == 1.0 else f'{{ name = "{cell}", scale = {factor:g} }}')


def _means(name: str, cell: str) -> float | None:
    """What a column's cells are worth where its name is another's first word, with a known unit or none."""
    parts = _WORD_AND_UNIT.fullmatch(cell)
    if parts is None or parts["word"].lower() not in _FIRST_WORDS.get(name, ()):
        return None
    return worth(name, parts["unit"])
