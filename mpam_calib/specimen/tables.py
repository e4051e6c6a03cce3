"""The columns of each kind of data file, and what their values may be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np

from mpam_calib.errors import InputError
from mpam_calib.specimen.declaration import FileKind

if TYPE_CHECKING:
    import pandas as pd
    import pandera.pandas as pa

TEXT_COLUMNS: Final = frozenset({"branch"})
"""Columns that hold words; every other column holds numbers."""
GAPPED_COLUMNS: Final = frozenset({"temperature_C"})
"""Columns whose cells may be empty: an instrument slower than the load cell fills few rows."""
EMPTY: Final = ("", "nan", "NaN", "NAN")
"""What stands in such cells."""


@dataclass(frozen=True)
class Rule:
    """What the values of a column must be, beyond finite: a test on the column, and its words."""

    holds: Callable[[pd.Series[float]], pd.Series[bool]]
    expected: str


def _finite(values: pd.Series[float]) -> pd.Series[bool]:
    return values.abs() < np.inf


FINITE = Rule(_finite, "a finite number")
FLAG = Rule(lambda values: values.isin([0.0, 1.0]), "0 or 1")
COUNT = Rule(lambda values: (values >= 1) & (values % 1 == 0), "a whole number from 1")
FRACTION = Rule(
    lambda values: (values > -1.0) & (values < 1.0),
    "a fraction of L0 below 1 (a percentage needs scale = 0.01 in [columns])",
)
STRETCH = Rule(lambda values: values > -1.0, "an engineering strain above -1")

RULES: Final[dict[str, Rule]] = {
    "contraction": FRACTION,
    "censored": FLAG,
    "cycle": COUNT,
    "strain": STRETCH,
}


@dataclass(frozen=True)
class TableSpec:
    """A kind of data file: the columns it must have, those it may have, and those nothing is read from."""

    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    unread: tuple[str, ...] = ()

    @property
    def columns(self) -> tuple[str, ...]:
        """All columns that are read where they are there."""
        return self.required + self.optional

    @cached_property
    def schema(self) -> pa.DataFrameSchema:
        """The pandera schema of the number columns; its checks carry our words as their name."""
        import pandera.pandas as pa

        def column(name: str) -> pa.Column:
            rules = [FINITE, *([RULES[name]] if name in RULES else [])]
            checks = [pa.Check(rule.holds, name=rule.expected, n_failure_cases=1) for rule in rules]
            return pa.Column(float, checks, required=False, nullable=name in GAPPED_COLUMNS)

        return pa.DataFrameSchema({name: column(name) for name in self.columns if name not in TEXT_COLUMNS})

    def check(self, frame: pd.DataFrame, file: str) -> None:
        """Raise ``InputError`` for the first value of ``frame`` that a column may not hold.

        The frame's index holds the editor's row numbers.
        """
        from pandera.errors import SchemaError

        try:
            self.schema.validate(frame)
        except SchemaError as error:
            first = error.failure_cases.iloc[0]
            name = str(error.check.name)
            raise InputError(
                file, f"{first['failure_case']:g}", name, int(first["index"]), str(error.schema.name)
            ) from None


TABLES: Final[dict[FileKind, TableSpec]] = {
    "loops": TableSpec(
        ("time_s", "pressure_kPa", "displacement_mm", "force_N"),
        ("setpoint_kPa", "cycle", "branch", "temperature_C", "censored"),
    ),
    "force_map": TableSpec(
        ("pressure_kPa", "contraction", "force_N"),
        ("branch", "censored"),
        ("repeat",),
    ),
    "blocked_force": TableSpec(("pressure_kPa", "force_N"), ("censored",)),
    "free_contraction": TableSpec(("pressure_kPa", "contraction")),
    "tensile": TableSpec(("strain", "stress_Pa")),
}
"""What is read of each kind of file; every repeat of a force map is a reading, whatever its number."""
