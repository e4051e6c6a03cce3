"""A table that is made line by line goes on where it stopped."""

from __future__ import annotations

from pathlib import Path

from rig import sets
from rig.recipes import Recipe

from .resumed import completed

FIELDS = ["name", "seed"]


def line_of(recipe: Recipe) -> list[str] | None:
    """One line; None for a recipe that hides nothing."""
    return [recipe.name, str(recipe.seed)] if recipe.effects else None


def never(recipe: Recipe) -> list[str] | None:
    raise AssertionError(f"{recipe.name} is in the table")


def test_what_is_there_is_not_measured_again(tmp_path: Path) -> None:
    path = tmp_path / "table.csv"
    hiding = [r for r in sets.recipes("develop") if r.effects][:3]
    null = next(r for r in sets.recipes("develop") if not r.effects)
    assert completed(path, FIELDS, [null, *hiding[:2]], line_of, 1) == [
        {"name": r.name, "seed": str(r.seed)} for r in hiding[:2]
    ]
    before = path.read_bytes()
    completed(path, FIELDS, hiding[:2], never, 1)
    assert path.read_bytes() == before
    assert [line["name"] for line in completed(path, FIELDS, hiding, line_of, 1)] == [r.name for r in hiding]
    assert path.read_text().startswith("name,seed\n")
