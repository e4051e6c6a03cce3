"""The thesis's printed tables, read as printed: the text of every cell and how precise it is."""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

NAMES = (
    *(f"3.{i}" for i in range(1, 6)),
    *(f"4.{i}" for i in range(1, 13)),
)
"""Every table that the thesis prints."""


@dataclass(frozen=True)
class PrintedTable:
    """One table: ``cells[row][column]`` is the printed text; ``rows`` are the labels of its first column."""

    name: str
    head: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    cells: tuple[tuple[str, ...], ...]

    @property
    def source(self) -> str:
        """How the table is cited, ``Table 4.3``."""
        return f"Table {self.name}"

    def text(self, row: str, column: str) -> str:
        """The printed text of a cell."""
        return self.cells[self.rows.index(row)][self.columns.index(column)]

    def value(self, row: str, column: str) -> float:
        """The number in a cell (nan where the print has none)."""
        return number(self.text(row, column))

    def values(self) -> Array:
        """All cells as numbers, shape (rows, columns); nan where the print has none."""
        return np.array([[number(cell) for cell in row] for row in self.cells])


@lru_cache
def table(name: str) -> PrintedTable:
    """The printed table ``name``, such as ``"4.3"``.

    >>> table("4.3").text("50", "E_1 (Pa)")
    '4.6791e7'
    """
    path = files("mpam_calib.thesis") / "tables" / f"table_{name.replace('.', '_')}.csv"
    with path.open(encoding="utf-8") as stream:
        head, *body = list(csv.reader(stream))
    return PrintedTable(
        name=name,
        head=head[0],
        rows=tuple(row[0] for row in body),
        columns=tuple(head[1:]),
        cells=tuple(tuple(row[1:]) for row in body),
    )


def number(text: str) -> float:
    """A printed cell as a number, nan where it is not one.

    >>> number("-1.0822e8")
    -108220000.0
    >>> number("---")
    nan
    """
    try:
        return float(text)
    except ValueError:
        return math.nan


def half_unit(text: str) -> float:
    """Half a unit of the last printed digit: the rounding that the print allows.

    >>> half_unit("0.9952")
    5e-05
    >>> half_unit("1.4e6")
    50000.0
    >>> half_unit("120")
    0.5
    """
    mantissa, _, exponent = text.lower().partition("e")
    decimals = len(mantissa.partition(".")[2])
    # Through text: 0.5 * 10.0 ** -4 is not the double nearest to 5e-05.
    return float(f"5e{int(exponent or 0) - decimals - 1}")
