"""The oracle's margins for the sets of cases, as a table that is kept beside them (`margins_<set>.csv`).

Run from the directory above the package: `python -m rig.margins develop locked`.
Columns: case, group, true ids; margin over every set that lacks a true effect and over those that only add to
the truth [nats], whole and with every effect halved. Empty where nothing is hidden or something outside is.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from .case import record
from .oracle import Oracle
from .recipes import Recipe, build_case, halved
from .sets import recipes

COLUMNS = ("name", "group", "ids", "margin", "superset_margin", "margin_halved", "superset_margin_halved")


def table_path(name: str) -> Path:
    """Where the table of a set lies."""
    return Path(__file__).with_name(f"margins_{name}.csv")


def _round(value: float) -> str:
    """One decimal up to a thousand nats, which is all that ever decides."""
    return "" if value == float("inf") else f"{min(value, 1000.0):.1f}"


def row_of(recipe: Recipe) -> dict[str, str]:
    """One line of the table."""
    case = build_case(recipe)
    row = {"name": recipe.name, "group": recipe.group, "ids": " ".join(case.ids)}
    if recipe.outside:
        return row
    for suffix, one in (("", case), ("_halved", halved(case))):
        if suffix and not case.hidden:
            continue
        verdict = Oracle(record(one)).judge()
        row |= {
            f"margin{suffix}": _round(verdict.margin),
            f"superset_margin{suffix}": _round(verdict.superset_margin),
        }
    return row


def read_margins(name: str) -> dict[str, dict[str, str]]:
    """The kept table by case name."""
    with table_path(name).open(encoding="utf-8", newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def main(names: list[str]) -> None:
    """Write the tables of the named sets."""
    for name in names:
        with table_path(name).open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS, restval="", lineterminator="\n")
            writer.writeheader()
            for recipe in recipes(name):
                writer.writerow(row_of(recipe))
                file.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
