"""What a report page is made of: frozen blocks that know their content and nothing of HTML layout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar, Literal, TypeAlias

import numpy as np
import pandas as pd

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MplFigure

Level = Literal["good", "caution", "bad"]
"""How far a statement can be relied on."""

LEVEL_WORDS: dict[Level, str] = {"good": "in order", "caution": "with care", "bad": "not reliable"}


@dataclass(frozen=True)
class Headline:
    """The one sentence that answers the reader's question; set large. Escaped unless Markup."""

    html: str
    kind: ClassVar[str] = "headline"


@dataclass(frozen=True)
class Text:
    """A paragraph. Escaped unless it is :class:`markupsafe.Markup`; blank lines split paragraphs."""

    html: str
    kind: ClassVar[str] = "text"

    @property
    def paragraphs(self) -> list[str]:
        """The paragraphs of the text, each still Markup if the text is."""
        return [part for part in self.html.split("\n\n") if part.strip()]


@dataclass(frozen=True)
class Notice:
    """A boxed remark that must not be missed, such as where the data come from."""

    html: str
    kind: ClassVar[str] = "notice"


@dataclass(frozen=True)
class Verdict:
    """Whether to trust what stands above it, in one sentence, and why."""

    sentence: str
    level: Level
    reasons: Sequence[str] = ()
    kind: ClassVar[str] = "verdict"

    @property
    def level_words(self) -> str:
        """The level in words, for readers who do not see its colour."""
        return LEVEL_WORDS[self.level]


@dataclass(frozen=True)
class KeyNumber:
    """One big number on a card: already formatted value, unit and band, and a note below."""

    label: str
    value: str
    unit: str = ""
    band_text: str = ""
    note: str = ""


@dataclass(frozen=True)
class Numbers:
    """A row of big-number cards."""

    items: Sequence[KeyNumber]
    kind: ClassVar[str] = "numbers"


@dataclass(frozen=True)
class Figure:
    """A matplotlib figure with its caption and a description for those who cannot see it."""

    figure: MplFigure
    caption: str
    alt: str
    kind: ClassVar[str] = "figure"

    @property
    def width_rem(self) -> float:
        """Width on the page, so that text is as large in every figure."""
        return 7.4 * float(self.figure.get_figwidth())

    @property
    def data_uri(self) -> str:
        """The drawing as a data URI, the same bytes for the same figure; closes the figure."""
        from mpam_calib.report.embed import data_uri

        return data_uri(self.figure)


@dataclass(frozen=True)
class DataTable:
    """A table. ``formats`` maps a column to a format string such as ``"{:.2f}"``.

    Columns of numbers and columns named in ``formats`` are aligned right; missing values print as a
    dash. ``collapse`` folds the table behind its caption.
    """

    frame: pd.DataFrame
    caption: str
    formats: Mapping[str, str] | None = None
    collapse: bool = False
    kind: ClassVar[str] = "table"

    @property
    def header(self) -> list[tuple[str, bool]]:
        """Column names and whether each is aligned right."""
        named = self.formats or {}
        return [
            (str(name), str(name) in named or _is_number(self.frame[name])) for name in self.frame.columns
        ]

    @property
    def rows(self) -> list[list[str]]:
        """Cells as text, row by row."""
        named = self.formats or {}
        columns = [
            [_cell(value, named.get(str(name))) for value in self.frame[name]] for name in self.frame.columns
        ]
        return [list(row) for row in zip(*columns, strict=True)]


def _is_number(column: pd.Series) -> bool:
    return pd.api.types.is_numeric_dtype(column) and not pd.api.types.is_bool_dtype(column)


def _cell(value: object, template: str | None) -> str:
    if value is None or value is pd.NA or (isinstance(value, float) and value != value):
        return "–"
    if template is not None:
        return template.format(value)
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


Block: TypeAlias = Headline | Text | Notice | Verdict | Numbers | Figure | DataTable


@dataclass(frozen=True)
class Section:
    """A titled run of blocks; ``note`` is a sentence below the title that says how to read it."""

    title: str
    blocks: Sequence[Block] = field(default_factory=tuple)
    note: str = ""
