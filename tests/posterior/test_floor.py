"""Slack readings that noise lifts above the floor: found where there is a floor, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build

from mpam_calib.posterior.likelihood.bins import _beyond_slack
from mpam_calib.posterior.likelihood.floor import lifted_by_noise, pulling
from mpam_calib.posterior.likelihood.points import gather_points
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import BlockedForce, ForceMap

NOISE = 0.1
LEVELS = np.array([50.0, 110.0, 160.0, 240.0])
CURVE, PLACE = (a.ravel() for a in np.meshgrid(np.arange(4), np.linspace(0.0, 0.4, 41), indexing="ij"))
TRUE = 40.0 * LEVELS[CURVE] / 240.0 - 90.0 * PLACE - 60.0 * PLACE**2
"""Curves that end where they cross zero, at 9 to 33 of their 41 places."""


def read(seed: int, floor: float = 0.0, sd: float = NOISE) -> np.ndarray:
    noise = sd * np.random.default_rng(seed).standard_normal(len(TRUE))
    return np.maximum(TRUE, floor) + noise


@pytest.mark.parametrize("floor", [0.0, 0.7])
@pytest.mark.parametrize("told", [True, False])
@pytest.mark.parametrize("held", [False, True])
def test_lifted_readings_are_found_and_no_pull_is_lost(floor: float, told: bool, held: bool) -> None:
    """Also where the flagged ones are held at the floor, as a rig that shows no push does."""
    lifted = pulled = 0
    for seed in range(20):
        force = read(seed, floor)
        flagged = force <= floor
        force = np.maximum(force, floor) if held else force
        found = lifted_by_noise(force, PLACE, CURVE, flagged, floor if told else None) | flagged
        deep, clear = floor > TRUE, floor + 8.0 * NOISE < TRUE
        lifted += int((deep & ~found).sum())
        pulled += int((clear & found).sum())
        assert 0.3 < flagged[deep].mean() < 0.7
    assert pulled == 0
    # Of 1,500 lifted readings.
    assert lifted <= 4


def test_a_sensor_that_clips_behind_its_noise_lifts_nothing() -> None:
    force = np.maximum(TRUE + NOISE * np.random.default_rng(0).standard_normal(len(TRUE)), 0.0)
    flagged = force <= 0.0
    found = lifted_by_noise(force, PLACE, CURVE, flagged, 0.0)
    assert not (found & ~flagged & (TRUE > 4.0 * NOISE)).any()


def test_a_wrong_flag_among_held_ones_hides_no_pull() -> None:
    force = np.maximum(read(6), 0.0)
    wrong = (CURVE == 3) & (PLACE[5] == PLACE)
    found = lifted_by_noise(np.where(wrong, 0.0, force), PLACE, CURVE, (force <= 0.0) | wrong, 0.0, NOISE)
    assert not (found & (TRUE > 8.0 * NOISE)).any()
    assert found[(TRUE < 0.0) & (force > 0.0)].mean() > 0.98


def test_a_muscle_that_pushes_has_no_floor() -> None:
    """Somebody declares a floor, and the cell reads what is below it: what is above it is a force."""
    force = TRUE + NOISE * np.random.default_rng(1).standard_normal(len(TRUE))
    assert not lifted_by_noise(force, PLACE, CURVE, force <= 0.0, 0.0).any()


def test_one_wrong_flag_hides_no_reading() -> None:
    force = np.maximum(read(2), 0.3 + read(2, sd=0.01))
    flagged = (CURVE == 3) & (PLACE[5] == PLACE)
    assert not lifted_by_noise(force, PLACE, CURVE, flagged, None).any()


def test_points_of_a_map_and_of_blocked_forces() -> None:
    force = read(3)
    grid = ForceMap(
        LEVELS[CURVE] * 1e3, PLACE, force, CURVE, np.zeros(len(force), dtype=np.int64), force <= 0.0
    )
    pressure = np.linspace(0.0, 2e5, 60)
    true = 3e-4 * (pressure - 8e4)
    blocked = np.maximum(true, 0.0) + NOISE * np.random.default_rng(4).standard_normal(60)
    made = build.specimen(
        levels_kPa=tuple(LEVELS.tolist()),
        force_map=grid,
        blocked_force=BlockedForce(pressure, blocked, blocked <= 0.0),
        sensors=Sensors(force_floor_N=0.0),
    )
    points = gather_points(made)
    assert points is not None
    every = np.concatenate([TRUE, true])
    assert points.censored[every < 0.0].mean() > 0.98
    assert not points.censored[every > 8.0 * NOISE].any()


def test_rows_of_loops_that_pull() -> None:
    recorded = build.loops((100.0, 150.0, 200.0), 12.0, 200, cycles=2, dt=0.01)
    true = 30.0 - 4e3 * recorded.displacement_m + 5e-5 * (recorded.pressure_Pa - 1e5)
    noise = NOISE * np.random.default_rng(5).standard_normal(len(true))
    force = np.maximum(true, 0.0) + noise
    held = replace(recorded, force_N=force, censored=force <= 0.0)
    found = pulling(held)
    assert not found[true < 0.0].any()
    assert found[true > 8.0 * NOISE].all()
    unclear = np.zeros(len(true), dtype=bool)
    unclear[:7] = True
    assert not pulling(replace(held, unclear=unclear))[:7].any()
    assert pulling(replace(recorded, force_N=true + noise)).all()


def test_one_wrong_flag_in_loops_hides_one_row() -> None:
    recorded = build.loops((100.0, 150.0, 200.0), 12.0, 200, cycles=2, dt=0.01)
    force = 60.0 - 4e3 * recorded.displacement_m
    wrong = np.arange(len(force)) == 100
    np.testing.assert_array_equal(pulling(replace(recorded, force_N=force, censored=wrong)), ~wrong)


def test_slack_begins_where_half_of_the_strokes_of_a_level_and_branch_begin_it() -> None:
    """Three strokes begin it at 6, 8 and 9 mm; one of another branch, without any, is left as it is."""
    place = np.tile(np.arange(1.0, 11.0), 4)
    segment, group = np.repeat(np.arange(4), 10), np.repeat([0, 0, 0, 1], 10)
    slack = place == np.array([6.0, 8.0, 9.0, np.inf])[segment]
    found = _beyond_slack(slack, place, segment, group)
    assert np.array_equal(found, slack | ((group == 0) & (place >= 8.0)))
    assert not _beyond_slack(np.zeros(40, dtype=bool), place, segment, group).any()
