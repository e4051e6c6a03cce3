"""A table that is made line by line: a second run goes on where the first stopped."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from rig.recipes import Recipe

from mpam_calib.posterior.density.pool import settle_worker


def reported(name: str) -> Path:
    """Where a report of this name is kept."""
    return Path(__file__).parents[2] / "reports" / name


def completed(
    path: Path,
    fields: Sequence[str],
    todo: Sequence[Recipe],
    measure: Callable[[Recipe], list[str] | None],
    workers: int,
) -> list[dict[str, str]]:
    """All lines of the table, those of recipes that it lacks (by name, the first field) measured and added.

    A recipe of which None is measured makes no line.
    """
    path.parent.mkdir(exist_ok=True)
    done = _lines(path) if path.exists() else []
    names = {line[fields[0]] for line in done}
    with path.open("a", newline="") as file, ProcessPoolExecutor(workers, initializer=settle_worker) as pool:
        writer = csv.writer(file, lineterminator="\n")
        if not done:
            writer.writerow(fields)
        for line in pool.map(measure, [recipe for recipe in todo if recipe.name not in names]):
            if line is not None:
                writer.writerow(line)
                file.flush()
    return _lines(path)


def _lines(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))
