"""Which of very many recordings a search looks at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model.build import loops
from rig import recipes

from criticism.cases import null_recipe, problem_of, read_case
from mpam_calib.criticism.data import build as module
from mpam_calib.criticism.data import rows
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.likelihood.points import Points
from mpam_calib.report.wording import left_aside
from mpam_calib.specimen import Specimen

CYCLES = 40


@pytest.fixture(scope="module")
def durable() -> Specimen:
    """Two levels with forty cycles each."""
    recipe = replace(
        null_recipe(),
        levels=2,
        cycles=CYCLES,
        speeds=1,
        rows_max=6000,
        dwell=False,
        motion="triangle",
        floor=False,
    )
    return read_case(recipes.build_case(recipe))


def test_long_strokes_are_looked_at_both_ways() -> None:
    """What a fault does shows in raw readings, however many there are to a stroke."""
    raw = rows.Rows.of(loops((100.0, 150.0), rows=45_000, dt=1e-3))
    assert set(raw.readings.sign.tolist()) == {-1.0, 1.0}
    assert len(np.unique(raw.stroke)) == 4


def test_of_many_cycles_the_first_and_the_last_are_looked_at(durable: Specimen) -> None:
    problem = problem_of(durable)
    for level in np.unique(problem.level):
        cycles = np.unique(problem.cycle[problem.level == level])
        assert {1, 2, CYCLES} <= set(cycles.tolist())
        assert len(cycles) < CYCLES / 1.5
    assert len(np.unique(problem.stroke)) <= rows.MOST_STROKES
    (said,) = left_aside(durable, "search")
    assert f"of {4 * CYCLES} strokes" in said


def test_what_is_looked_at_is_as_it_was(durable: Specimen, monkeypatch: pytest.MonkeyPatch) -> None:
    """Time at the level, way since the turn and noise know of the cycles that are left out."""
    monkeypatch.setattr(module, "ROWS", 0)  # As few rows in each stroke, however many strokes there are.
    some = problem_of(durable)
    monkeypatch.setattr(rows, "MOST_STROKES", 10 * CYCLES)
    every = problem_of(durable)
    kept = np.isin(every.stroke, some.stroke)
    assert kept.sum() == len(some) < len(every)
    np.testing.assert_array_equal(every.force[kept], some.force)
    np.testing.assert_allclose(every.noise[np.ix_(kept, kept)], some.noise, rtol=1e-12)
    both = np.concatenate([kept, kept])
    for name in ("travel", "reversal", "time_at_level", "displacement", "cycle", "speed"):
        np.testing.assert_array_equal(getattr(every.readings, name)[both], getattr(some.readings, name))


def points_at(pressure: np.ndarray) -> Points:
    """Static readings of a map; one is censored, one is a free contraction."""
    n = len(pressure)
    readings = Readings.at_rest(pressure, np.zeros(n))
    kind = np.zeros(n, dtype=np.int64)
    kind[1] = 2
    return Points(readings, np.full(n, 10.0), np.arange(n) == 0, kind)


def test_few_are_all_looked_at() -> None:
    found, usable = rows.telling_points(points_at(np.full(rows.MOST_POINTS, 1e5)))
    np.testing.assert_array_equal(found, np.arange(2, rows.MOST_POINTS))
    assert usable == rows.MOST_POINTS - 2


def test_of_many_static_readings_every_pressure_is_looked_at() -> None:
    pressure = np.tile(np.linspace(1e5, 5e5, 9), 300)
    found, usable = rows.telling_points(points_at(pressure))
    assert (len(found), usable) == (rows.MOST_POINTS, len(pressure) - 2)
    counts = np.unique(pressure[found], return_counts=True)[1]
    assert len(counts) == 9
    assert counts.max() - counts.min() <= 2
