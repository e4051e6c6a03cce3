"""What ``check`` says of parts that are not there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from criticism.cases import specimen_of

from mpam_calib.cli.check import _missing
from mpam_calib.specimen import read

MAP = """\
specimen = { name = "map" }
geometry = { L0_mm = 120, R0_mm = 8, t0_mm = 1.5, alpha0_deg = 65 }
files = { force_map = "map.csv" }
simulation = { order = 1, law = "constant", friction = "coulomb" }
"""
"""A muscle whose forces were read at rest."""


def test_without_a_braid_strands_may_still_be_named() -> None:
    """As the diagnosis page says, which states their size for strands that it assumes."""
    specimen = replace(specimen_of("develop-null-006"), braid=None)
    (words,) = (line for line in _missing(specimen) if line.startswith("[braid]"))
    assert "its size is stated for nylon strands that it assumes" in words


@pytest.mark.parametrize(
    ("branches", "untold"),
    [(["loading", "unloading"], "history"), (["loading"], "friction and history")],
)
def test_a_force_map_of_both_branches_tells_friction(
    tmp_path: Path, branches: list[str], untold: str
) -> None:
    rows = [f"100,{0.05 * i},{100 - 20 * i},{branch}" for i in range(4) for branch in branches]
    (tmp_path / "specimen.toml").write_text(MAP)
    (tmp_path / "map.csv").write_text("\n".join(["pressure_kPa,contraction,force_N,branch", *rows]))
    assert f"loops: {untold} cannot be told" in _missing(read(tmp_path))
