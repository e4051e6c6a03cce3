"""A row of units between header and data, as many testers write it: checked against the columns' own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from mpam_calib.errors import InputError
from mpam_calib.specimen.tables import TEXT_COLUMNS
from mpam_calib.specimen.wording import quoted

if TYPE_CHECKING:
    from mpam_calib.specimen.text_format import Field

_PLAIN: Final = {"": 1.0, "-": 1.0, "mm/mm": 1.0, "m/m": 1.0, "%": 0.01}
_IN: Final[dict[str, dict[str, float]]] = {
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0},
    "kPa": {"kpa": 1.0, "pa": 1e-3, "hpa": 0.1, "mbar": 0.1, "mpa": 1e3, "bar": 100.0, "psi": 6.894757},
    "mm": {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "cm": 10.0, "m": 1e3, "in": 25.4, "inch": 25.4},
    "N": {"n": 1.0, "mn": 1e-3, "g": 9.80665e-3, "kg": 9.80665, "kgf": 9.80665, "lbf": 4.448222, "kn": 1e3},
    "Pa": {"pa": 1.0, "kpa": 1e3, "mpa": 1e6},
    "C": {"°c": 1.0, "c": 1.0, "degc": 1.0},
}
"""What one unit is worth in that of a column's name, by its spelling in lower case."""


def is_units_row(label: str, row: int, cells: Sequence[str], fields: Sequence[Field]) -> bool:
    """Whether the ``cells`` of a row (counted from 1) are units of all columns that are read.

    Raises ``InputError`` where they are, but one is not its column's and no scale is declared for it.
    """
    read = [field for field in fields if field.name not in TEXT_COLUMNS and field.position < len(cells)]
    written = {field: cells[field.position].strip().strip("[]()") for field in read}
    worth = {field: _worth(field.name, unit) for field, unit in written.items()}
    if not any(written.values()) or None in worth.values():
        return False
    for field, factor in worth.items():
        if factor != 1.0 and (field.scale, field.offset) == (1.0, 0.0):
            found = f"the unit {quoted(written[field])}"
            expected = f"{field.name.rpartition('_')[2]}, or scale = {factor:g} for it in [columns]"
            raise InputError(label, found, expected, row, field.name)
    return True


def _worth(name: str, unit: str) -> float | None:
    """What a unit is worth in that of a column's name; None for a word that is none of its units."""
    known = _IN.get(name.rpartition("_")[2], _PLAIN)
    return 1.0 if not unit else known.get(unit.lower())
