"""What ``check`` says about a load cell's readings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
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


def to_free_contraction(levels: tuple[float, ...] = (50.0, 100.0, 150.0, 200.0), dwell: int = 0) -> Recording:
    """Loops that end where the muscle pulls with nothing."""
    made = loops(levels, dwell=dwell)
    free = 5.0 + 0.05 * made.pressure
    force = 0.3 * made.pressure * (1.0 - made.displacement / free) * (1.0 + 0.05 * made.branch)
    return replace(made, force=force)


ZERO = "the load cell zeroed"


@pytest.mark.parametrize(
    ("by", "said"),
    [
        pytest.param({}, "", id="zeroed"),
        pytest.param(
            dict.fromkeys((50.0, 100.0, 150.0, 200.0), 10.0), "at each of 4 levels; was the", id="all"
        ),
        pytest.param(dict.fromkeys((50.0, 100.0, 150.0, 200.0), 1.0), "", id="all by little"),
        pytest.param({150.0: 10.0}, "smallest force at 150 kPa is 10.", id="one"),
        pytest.param({100.0: -10.0}, "smallest force at 100 kPa is -9.", id="one below"),
        pytest.param({150.0: 1.0}, "", id="one by little"),
        pytest.param({200.0: 10.0}, "", id="the last, which may end early"),
    ],
)
def test_a_zero_that_is_off(by: dict[float, float], said: str, tmp_path: Path) -> None:
    made = to_free_contraction()
    off = np.array([by.get(float(level), 0.0) for level in made.pressure])
    found = remarks(tmp_path, made, noisy(made.force) + off)
    assert (ZERO in found) == bool(said)
    assert said in found


@pytest.mark.parametrize(("by", "told"), [(0.0, False), (-30.0, True)])
def test_a_cell_that_was_zeroed_while_the_muscle_pulled(by: float, told: bool, tmp_path: Path) -> None:
    """Most of its forces are below 0, but not where the muscle is long: no sign is flipped."""
    made = to_free_contraction()
    force = noisy(made.force) + by
    assert (np.median(force) < 0.0) == told
    assert ("the median force is -" in remarks(tmp_path, made, force)) == told


@pytest.mark.parametrize("early", [{}, {100.0: 0.7}, {150.0: 0.8}, {50.0: 0.7, 200.0: 0.6}])
@pytest.mark.parametrize("share", [0.6, 0.9, 1.0])
def test_strokes_that_end_early_have_zeroed_cells(
    early: dict[float, float], share: float, tmp_path: Path
) -> None:
    """All at a share of their free contraction, or a level or two before the others."""
    made = to_free_contraction()
    shares = share * np.array([early.get(float(level), 1.0) for level in made.pressure])
    x = made.displacement * shares
    force = 0.3 * made.pressure * (1.0 - x / (5.0 + 0.05 * made.pressure)) * (1.0 + 0.05 * made.branch)
    assert ZERO not in remarks(tmp_path, replace(made, displacement=x), noisy(force))


def test_a_declared_floor_is_no_zero_that_is_off(tmp_path: Path) -> None:
    made = to_free_contraction()
    assert ZERO not in remarks(tmp_path, made, np.maximum(noisy(made.force), 10.0), FLOOR)


def hung(force: Array) -> Array:
    out = force.copy()
    out[30:70] = out[30]
    return out


@pytest.mark.parametrize(
    ("change", "said"),
    [
        pytest.param(hung, True, id="hung"),
        pytest.param(lambda f: f, False, id="sound"),
        pytest.param(lambda f: np.maximum(np.round(f), 12.0), False, id="slack on a coarse converter"),
        pytest.param(lambda f: 5.0 * np.round(f / 5.0), False, id="coarse converter"),
        pytest.param(lambda f: np.repeat(f[::12], 12)[: len(f)], False, id="a slow logger"),
        pytest.param(lambda f: np.minimum(f, 20.0), False, id="limit"),
    ],
)
def test_a_force_that_stands_still_while_the_muscle_moves(
    change: Callable[[Array], Array], said: bool, tmp_path: Path
) -> None:
    made = to_free_contraction(dwell=40)
    # A cell without noise repeats its force at rest, too.
    for i, sound in enumerate((made.force, noisy(made.force))):
        found = remarks(tmp_path / str(i), made, change(sound))
        assert ("did the load cell or its logger hang?" in found) == said
        if said:
            assert f"loops: the force stands at {sound[30]:.5g} N for 40 readings from 3 s" in found


@pytest.mark.parametrize(("lowest", "said"), [(120.0, False), (80.0, True)])
def test_levels_within_a_factor_of_two_may_well_end_at_one_force(
    lowest: float, said: bool, tmp_path: Path
) -> None:
    made = to_free_contraction((lowest, 150.0, 200.0))
    found = remarks(tmp_path, made, noisy(made.force + 10.0))
    assert ("at each of 3 levels; was the load cell zeroed" in found) == said
