"""What ``check`` says about a load cell's readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mpam_calib.specimen import read
from mpam_calib.specimen.extremes import saturated
from mpam_calib.specimen.oddities import oddities

from .folders import DECLARATION, Recording, loops, make

Array = NDArray[np.float64]


def remarks(folder: Path, made: Recording, force: Array, declaration: str = DECLARATION) -> str:
    columns = np.column_stack([made.time, made.pressure, made.displacement, force])
    lines = [",".join(f"{value:.6g}" for value in row) for row in columns]
    text = "\n".join(["time_s,pressure_kPa,displacement_mm,force_N", *lines]) + "\n"
    return " ".join(oddities(read(make(folder, declaration, loops=text))))


def noisy(force: Array) -> Array:
    return force + 0.1 * np.random.default_rng(2).normal(size=len(force))


FLOOR = DECLARATION.replace("[files]", "[sensors]\nforce_floor_N = 10.0\n[files]")


@pytest.mark.parametrize(
    ("step", "low", "high", "declaration", "said"),
    [
        pytest.param(0.0, -np.inf, np.inf, DECLARATION, "", id="none"),
        pytest.param(0.0, -np.inf, 30.0, DECLARATION, "30 N, the largest: did the load cell", id="limit"),
        pytest.param(0.0, 10.0, np.inf, DECLARATION, "10 N, the smallest: is the muscle slack", id="slack"),
        pytest.param(0.0, 10.0, np.inf, FLOOR, "", id="declared floor"),
        pytest.param(2.0, -np.inf, np.inf, DECLARATION, "", id="coarse converter"),
    ],
)
def test_a_force_that_many_readings_share(
    step: float, low: float, high: float, declaration: str, said: str, tmp_path: Path
) -> None:
    made = loops(dwell=40)
    force = np.clip(noisy(made.force), low, high)
    force = step * np.round(force / step) if step else force
    found = remarks(tmp_path, made, force, declaration)
    assert ("readings are exactly" in found) == bool(said)
    if said:
        count = int(np.sum(force == (high if "largest" in said else low)))
        assert f"loops: {count} of {len(force)} readings are exactly {said}" in found


def test_a_force_at_rest_may_stand_still(tmp_path: Path) -> None:
    """A quiet cell repeats the largest force while the crosshead dwells at the muscle's length."""
    made = loops(dwell=40)
    assert np.sum(made.force == made.force.max()) >= 40
    assert "readings are exactly" not in remarks(tmp_path, made, made.force)


def test_loops_without_a_force_above_the_floor_have_no_limit(tmp_path: Path) -> None:
    text = DECLARATION.replace("[files]", "[sensors]\nforce_floor_N = 100.0\n[files]").replace(
        'loops = "loops.csv"', 'loops = "loops.csv"\nblocked_force = "blocked_force.csv"'
    )
    blocked = "pressure_kPa,force_N\n" + "".join(f"{p},{p}\n" for p in (50, 100, 150))
    specimen = read(make(tmp_path, text, loops=loops().text(), blocked_force=blocked))
    assert specimen.loops is not None and specimen.loops.censored.all()
    assert not saturated(specimen.loops).any()
    assert "readings are exactly" not in " ".join(oddities(specimen))
