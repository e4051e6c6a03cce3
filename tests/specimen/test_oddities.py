"""What can be read but is hardly meant: ``check`` says so."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read
from mpam_calib.specimen.summary import oddities

from .folders import loops, make

Change = Callable[[list[list[str]]], None]


def times(column: int, factor: float) -> Change:
    def change(rows: list[list[str]]) -> None:
        for row in rows:
            row[column] = f"{factor * float(row[column]):.8g}"

    return change


def blip(rows: list[list[str]]) -> None:
    rows[7][3] = "-9999"


def remarks(folder: Path, change: Change | None = None) -> str:
    header, *body = loops().text().splitlines()
    rows = [line.split(",") for line in body]
    if change is not None:
        change(rows)
    return " ".join(oddities(read(make(folder, loops="\n".join([header, *map(",".join, rows)]) + "\n"))))


def test_nothing_is_odd_in_a_plain_test(tmp_path: Path) -> None:
    found = remarks(tmp_path)
    assert "far from" not in found and "gas alone" not in found


@pytest.mark.parametrize(
    ("change", "said"),
    [
        pytest.param(times(1, 0.01), "while the gas alone pulls about", id="bar"),
        pytest.param(times(3, 1e-3), "while the gas alone pulls about", id="kilonewtons"),
        pytest.param(times(3, 1e3), "while the gas alone pulls about", id="millinewtons"),
        pytest.param(blip, "a force is far from all others (-9999 N)", id="a missing value's code"),
    ],
)
def test_what_is_hardly_meant_is_said(change: Change, said: str, tmp_path: Path) -> None:
    assert said in remarks(tmp_path, change)


def test_per_cent_of_strain_are_refused(tmp_path: Path) -> None:
    folder = make(tmp_path, '[specimen]\nname = "Rubber"\n[files]\ntensile = "tensile.csv"\n')
    rows = "".join(f"{10.0 * k},{1e4 * k}\n" for k in range(12))
    (folder / "tensile.csv").write_text("strain,stress_Pa\n" + rows)
    with pytest.raises(InputError, match=r"tensile.csv:5:strain: found 30 \(per cent\?\)"):
        read(folder)
