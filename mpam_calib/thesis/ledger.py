"""Printed against computed, one row each, with a verdict that a difference cannot escape."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd

from mpam_calib.thesis.tables import PrintedTable, half_unit, number

REPRODUCED, MISPRINT, NOT_REPRODUCIBLE = "reproduced", "misprint", "not reproducible"
COLUMNS = ("source", "row", "column", "printed", "computed", "relative_difference", "verdict", "note")

SOLVER = 1e-6
"""Relative slack for numbers that an optimiser stopped at."""
FROM_MEASUREMENT = "fitted to or read off measurements that are lost"


@dataclass(frozen=True)
class Row:
    """One printed number (``printed`` is its text, "" where nothing is printed) and ours (nan: none)."""

    source: str
    row: str
    column: str
    printed: str
    computed: float
    verdict: str
    note: str

    @property
    def relative_difference(self) -> float:
        """(computed − printed) / |printed|; nan without either, or where the print is 0."""
        printed = number(self.printed)
        return (self.computed - printed) / abs(printed) if printed else math.nan


@dataclass
class Ledger:
    """The rows of ``reproduction.csv`` in the order in which they were entered."""

    rows: list[Row] = field(default_factory=list)

    def check(
        self,
        source: str,
        row: str,
        column: str,
        printed: str,
        computed: float,
        *,
        note: str = "",
        misprint: str = "",
        allow: float = 0.0,
        about: float = 0.0,
    ) -> Row:
        """Compare a printed number with a computed one.

        The print is allowed half a unit of its last digit, ``allow`` for the rounding of the numbers it was
        computed from, ``about`` (relative) where the text says "almost" or "nearly", and an optimiser's 1e-6.
        ``misprint`` explains a difference beyond that; one that nobody has explained is an error, so that no
        verdict is reached by default.
        """
        value = number(printed)
        slack = half_unit(printed) + allow + (SOLVER + about) * abs(value)
        if abs(computed - value) <= slack:
            return self._add(source, row, column, printed, computed, REPRODUCED, note)
        if not misprint:
            raise ValueError(f"{source} [{row}, {column}]: printed {printed}, computed {computed:.8g}")
        return self._add(source, row, column, printed, computed, MISPRINT, misprint)

    def contradicted(
        self, source: str, row: str, column: str, printed: str, computed: float, note: str
    ) -> Row:
        """A printed number that rounds to the right value or means another quantity than it says."""
        return self._add(source, row, column, printed, computed, MISPRINT, note)

    def lost(
        self, source: str, row: str, column: str, printed: str, note: str, computed: float = math.nan
    ) -> Row:
        """A printed number that only lost measurements could give; ``computed`` is the nearest we have."""
        return self._add(source, row, column, printed, computed, NOT_REPRODUCIBLE, note)

    def unprinted(self, source: str, row: str, column: str, computed: float, note: str) -> Row:
        """A value of ours that the thesis does not print as a number (a lost figure, a check)."""
        note = f"nothing printed to compare with; {note}"
        return self._add(source, row, column, "", computed, NOT_REPRODUCIBLE, note)

    def _add(
        self, source: str, row: str, column: str, printed: str, computed: float, verdict: str, note: str
    ) -> Row:
        entry = Row(source, row, column, printed, float(computed), verdict, note)
        self.rows.append(entry)
        return entry

    def frame(self) -> pd.DataFrame:
        """All rows with the columns of ``reproduction.csv``."""
        return pd.DataFrame([[getattr(r, name) for name in COLUMNS] for r in self.rows], columns=COLUMNS)

    def write(self, path: Path) -> None:
        """Write ``reproduction.csv``: ten significant digits, the same bytes every time."""
        self.frame().to_csv(path, index=False, float_format="%.10g", lineterminator="\n")

    def counts(self) -> dict[str, int]:
        """How many printed numbers have each verdict, and how many rows have nothing printed."""
        found = Counter(r.verdict for r in self.rows if r.printed)
        return {
            **{v: found[v] for v in (REPRODUCED, MISPRINT, NOT_REPRODUCIBLE)},
            "unprinted": sum(1 for r in self.rows if not r.printed),
        }

    def summary(self) -> str:
        """The counts in one line."""
        n = self.counts()
        return (
            f"{sum(n.values()) - n['unprinted']} printed numbers: {n[REPRODUCED]} reproduced, "
            f"{n[MISPRINT]} misprint, {n[NOT_REPRODUCIBLE]} not reproducible "
            f"(and {n['unprinted']} recomputed values that the thesis does not print as numbers)"
        )


def lost_table(ledger: Ledger, table: PrintedTable, note: str) -> None:
    """Enter every number of a table as one that only lost measurements could give."""
    for row in table.rows:
        for column in table.columns:
            if not math.isnan(table.value(row, column)):
                ledger.lost(table.source, row, column, table.text(row, column), note)
