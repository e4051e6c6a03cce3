"""The same readings twice."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read
from mpam_calib.specimen.oddities import oddities

from .folders import DECLARATION, loops, make


@pytest.mark.parametrize("same", [True, False])
def test_one_recording_under_two_names_is_refused(same: bool, tmp_path: Path) -> None:
    text = DECLARATION.replace('"loops.csv"', '["a.csv", "b.csv", "c.csv"]')
    levels = (50.0, 100.0, 100.0 if same else 150.0)
    files = {name: loops((level,)).text() for name, level in zip("abc", levels, strict=True)}
    folder = make(tmp_path, text, **files)
    if not same:
        assert len(read(folder).levels_Pa) == 3
        return
    with pytest.raises(
        InputError, match=r'files\.loops: found the same content in "b\.csv" and "c\.csv", exp'
    ):
        read(folder)


@pytest.mark.parametrize(
    ("step", "pasted", "said"),
    [
        pytest.param(0.01, 10, True, id="pasted"),
        pytest.param(0.01, 0, False, id="plain"),
        pytest.param(0.01, 3, False, id="a few by chance"),
        pytest.param(1.0, 10, False, id="a cell that shows newtons"),
    ],
)
def test_rows_of_a_force_map_pasted_twice(step: float, pasted: int, said: bool, tmp_path: Path) -> None:
    text = DECLARATION.replace('loops = "loops.csv"', 'force_map = "force_map.csv"')
    noise = np.random.default_rng(0)
    rows = []
    for pressure in (100.0, 200.0):
        for contraction in np.linspace(0.0, 0.3, 10):
            force = 0.3 * pressure * (1.0 - contraction / 0.35) + 0.05 * noise.normal()
            rows.append(f"{pressure:g},{contraction:.4f},{step * np.round(force / step):.6g}")
    # Slack rows are alike by themselves.
    rows += ["100,0.4,0"] * 8 + rows[:pasted]
    folder = make(tmp_path, text, force_map="\n".join(["pressure_kPa,contraction,force_N", *rows]) + "\n")
    found = " ".join(oddities(read(folder)))
    assert (f"force_map: {pasted} of {len(rows)} rows are other rows again" in found) == said
    assert ("pasted twice" in found) == said
