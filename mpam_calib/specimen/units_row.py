"""Units that a file states, below its header or in a mapped name: checked against the columns' own."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from mpam_calib.errors import InputError
from mpam_calib.specimen.tables import TEXT_COLUMNS
from mpam_calib.specimen.wording import listed, quoted

if TYPE_CHECKING:
    from mpam_calib.specimen.text_format import Field

_PLAIN: Final = {"": 1.0, "-": 1.0, "mm/mm": 1.0, "m/m": 1.0, "%": 0.01}
_IN: Final[dict[str, dict[str, float]]] = {
    "s": {"s": 1.0, "sec": 1.0, "ms": 1e-3, "min": 60.0},
    "kPa": {"kPa": 1.0, "Pa": 1e-3, "hPa": 0.1, "mbar": 0.1, "MPa": 1e3, "bar": 100.0, "psi": 6.894757},
    "mm": {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "cm": 10.0, "m": 1e3, "in": 25.4, "inch": 25.4},
    "N": {"N": 1.0, "mN": 1e-3, "g": 9.80665e-3, "kg": 9.80665, "kgf": 9.80665, "lbf": 4.448222, "kN": 1e3},
    "Pa": {"Pa": 1.0, "kPa": 1e3, "MPa": 1e6, "N/mm²": 1e6, "N/mm2": 1e6, "N/mm^2": 1e6, "psi": 6894.757},
    "C": {"°C": 1.0, "C": 1.0, "degC": 1.0},
}
"""What one unit is worth in that of a column's name; how it is capitalised does not matter."""
_IN_FULL: Final = {
    "second": "s", "seconds": "s", "minutes": "min", "newton": "n", "newtons": "n",
    "millimetres": "mm", "millimeters": "mm", "kilopascal": "kpa", "kilopascals": "kpa",
}  # fmt: skip
ALIKE = 0.05
"""A scale is a unit's within this share of it: it may hold a sensor's own gain, which is near one."""

_AT_THE_END: Final = re.compile(r".*(?:\[([^\[\]()]+)\]|\(([^\[\]()]+)\)|/([^/\[\]()]+))\s*")


def is_units_row(label: str, row: int, cells: Sequence[str], fields: Sequence[Field]) -> bool:
    """Whether the ``cells`` of a row (counted from 1) are units of all columns that are read.

    Raises ``InputError`` where they are, but the scale declared for one is another unit's, and at a word
    beside units that is none.
    """
    read = [field for field in fields if field.name not in TEXT_COLUMNS and field.position < len(cells)]
    written = {field: cells[field.position].strip().strip("[]()") for field in read}
    known = {field for field, unit in written.items() if _is_unit(field, unit)}
    if not any(written[field] for field in known):
        return False
    for field, unit in written.items():
        if field not in known:
            if _is_number(unit):
                return False
            raise _unknown(label, row, field, cells[field.position].strip())
    for field, unit in written.items():
        _check_scale(label, row, field, unit)
    return True


def are_units(cells: Sequence[str]) -> bool:
    """Whether all cells of a row are units of anything, or empty."""
    return all(_of_anything(cell.strip().strip("[]()")) for cell in cells)


def _is_unit(field: Field, unit: str) -> bool:
    """Whether a word is a unit of the column, or any at all where the map makes another quantity of it.

    Extension becomes strain by a scale that is no unit's, and its unit is a length's.
    """
    return worth(field.name, unit) is not None or (_changed(field) and _of_anything(unit))


def _changed(field: Field) -> bool:
    return not any(_alike(abs(field.scale), each) for each in _units(field.name).values())


def _of_anything(unit: str) -> bool:
    return any(_worth(units, unit) is not None for units in (_PLAIN, *_IN.values()))


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _unknown(label: str, row: int, field: Field, cell: str) -> InputError:
    expected = f"one of {listed(filter(None, _units(field.name)))}"
    if _changed(field):
        expected = "the unit of a time, a pressure, a length or a force"
    return InputError(label, f"the unknown unit {quoted(cell)}", expected, row, field.name)


def check_header_units(label: str, row: int, header: Sequence[str], fields: Sequence[Field]) -> None:
    """Refuse a mapped name that ends in a unit of another scale (``Load [lbf]``, ``p/bar``).

    ``row`` is the header's. What is none of the column's units is taken for a part of the name.
    """
    for field in fields:
        written = header[field.position]
        if field.name not in TEXT_COLUMNS and written != field.name:
            _check_scale(label, row, field, _stated_unit(written))


def _stated_unit(name: str) -> str:
    """What a column's name ends in, in brackets or behind a slash; nothing where it does not.

    >>> _stated_unit("Load [lbf]"), _stated_unit("p/bar"), _stated_unit("Load")
    ('lbf', 'bar', '')
    """
    found = _AT_THE_END.fullmatch(name)
    return next(filter(None, found.groups())).strip() if found else ""


def _check_scale(label: str, row: int, field: Field, unit: str) -> None:
    """Refuse a scale that is another unit's; any that is none is a lever's, or an area's."""
    factor, size = worth(field.name, unit), abs(field.scale)
    others = {each for each in _units(field.name).values() if each != factor}
    if not unit or factor is None or _alike(size, factor) or not any(_alike(size, w) for w in others):
        return
    found, expected = f"the unit {quoted(unit)}", field.name.rpartition("_")[2]
    if field.scale == 1.0:
        expected += f", or scale = {factor:g} for it in [columns]"
    else:
        found += f" with scale = {field.scale:g}"
        expected = f"scale = {math.copysign(factor, field.scale):g} for it in [columns]"
    raise InputError(label, found, expected, row, field.name)


def _alike(size: float, unit: float) -> bool:
    return abs(size / unit - 1.0) < ALIKE


def _units(name: str) -> dict[str, float]:
    """The units that a column may be in, and what they are worth in that of its name."""
    return _IN.get(name.rpartition("_")[2], _PLAIN)


def worth(name: str, unit: str) -> float | None:
    """What a unit is worth in that of a column's name; None for a word that is none of its units."""
    return 1.0 if not unit else _worth(_units(name), unit)


def _worth(units: dict[str, float], unit: str) -> float | None:
    plain = _IN_FULL.get(unit.lower(), unit.lower())
    return next((factor for each, factor in units.items() if each.lower() == plain), None)
