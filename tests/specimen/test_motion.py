"""Branches, cycles and strokes read off noisy synthetic motion whose truth is known."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mpam_calib.specimen.cycles import cycles_at_turns, number_cycles
from mpam_calib.specimen.motion import (
    noise_sd,
    read_motion,
    run_ids,
    turn_threshold,
    turning_points,
)

from .folders import loops

MOTIONS: dict[str, dict[str, Any]] = {
    "clean": {},
    "encoder noise": {"encoder_sd": 0.01, "rate": 100.0},
    "much encoder noise": {"encoder_sd": 0.05, "rate": 100.0},
    "coarse encoder": {"quantum": 0.05, "encoder_sd": 0.01, "rate": 100.0},
    "holds": {"dwell": 200, "encoder_sd": 0.01, "rate": 100.0},
    "long holds": {"dwell": 5000, "encoder_sd": 0.02, "rate": 100.0},
    "two speeds": {"speeds": (0.8, 4.0), "encoder_sd": 0.01, "rate": 50.0},
    "few rows": {"rate": 2.0},
}


def zigzag(values: list[float], threshold: float) -> int:
    """Number of strokes that a hysteresis comparator counts, row by row."""
    low = high = values[0]
    direction = strokes = 0
    for value in values:
        if direction >= 0 and value > high:
            high = value
        if direction <= 0 and value < low:
            low = value
        if direction != 1 and value - low >= threshold:
            direction, high = 1, value
            strokes += 1
        elif direction != -1 and high - value >= threshold:
            direction, low = -1, value
            strokes += 1
    return strokes


@pytest.mark.parametrize("name", MOTIONS)
@pytest.mark.parametrize("seed", range(3))
def test_branch_of_nearly_every_row(name: str, seed: int) -> None:
    recording = loops(levels=(100.0,), cycles=3, seed=seed, **MOTIONS[name])
    x = recording.displacement
    found = read_motion(x, turn_threshold(x), noise_sd(x)).branch
    assert set(np.unique(found)) == {-1, 1}
    strokes = run_ids(found)[-1] + 1
    assert strokes == run_ids(recording.branch)[-1] + 1
    # Where a turn stands is uncertain by the rows that the noise covers.
    per_turn = np.count_nonzero(found != recording.branch) / strokes
    rows_in_noise = 6.0 * MOTIONS[name].get("encoder_sd", 0.0) * MOTIONS[name].get("rate", 10.0) / 0.8
    assert per_turn <= 2 + rows_in_noise


@pytest.mark.parametrize("rows", [15, 100, 400])
@pytest.mark.parametrize("ratio", [1.0, 3.0, 5.0])
@pytest.mark.parametrize("gentle", [False, True])
def test_strokes_of_different_speeds_meet_at_their_turn(gentle: bool, ratio: float, rows: int) -> None:
    """Slow, fast and slow cycles at full speed into the turn or gently; 5 turns each, no noise."""
    rng = np.random.default_rng(3)
    wrong = []
    for _ in range(20):
        time = 20.0 / np.repeat([1.0, ratio, 1.0], 2)
        ends = np.concatenate([[0.0], np.cumsum(time)])
        t = np.arange(rng.uniform(0.0, 1.0), ends[-1] * ratio * rows / 20.0) * 20.0 / (ratio * rows)
        t = t[t < ends[-1]]
        number = np.searchsorted(ends, t, side="right") - 1
        share = (t - ends[number]) / time[number]
        way = 0.5 * (1.0 - np.cos(np.pi * share)) if gentle else share
        x = 20.0 * np.where(number % 2 == 0, way, 1.0 - way)
        found = read_motion(x, turn_threshold(x), noise_sd(x)).branch
        wrong.append(np.count_nonzero(found != np.where(number % 2 == 0, -1, 1)))
    assert np.mean(wrong) / 5 < 0.05


@pytest.mark.parametrize("sd", [0.0, 0.002])
@pytest.mark.parametrize("rows", [5, 9, 14])
def test_sharp_turns_of_strokes_of_few_rows(rows: int, sd: float) -> None:
    """A reading at each turn: one row in nine turns, which is no noise. ``sd`` in strokes."""
    way = np.arange(1, rows + 1) / rows
    x = np.tile(np.concatenate([way, 1.0 - way]), 12)
    x = x + sd * np.random.default_rng(1).standard_normal(len(x))
    truth = np.tile(np.repeat([-1, 1], rows), 12)
    found = read_motion(x, turn_threshold(x), noise_sd(x))
    assert (found.branch == truth)[~found.unclear].all()
    assert found.unclear.sum() <= 24


@pytest.mark.parametrize("rows", [15, 40, 100, 400])
@pytest.mark.parametrize("ratio", [1.0, 5.0])
@pytest.mark.parametrize("gentle", [False, True])
def test_a_hold_goes_with_the_stroke_before_it(gentle: bool, ratio: float, rows: int) -> None:
    """Holds of a tenth to a quarter of a slow stroke, reached and left at full speed or gently; no noise.

    ``rows`` are those of a fast stroke. What is left are readings at the end of a hold, from which a gentle
    crosshead has not moved yet.
    """
    rng = np.random.default_rng(3)
    wrong = []
    for _ in range(10):
        time = 20.0 / np.repeat([1.0, ratio, 1.0], 2)
        hold = rng.uniform(2.0, 5.0)
        ends = np.concatenate([[0.0], np.cumsum(time + hold)])
        step = 20.0 / (ratio * rows)
        t = np.arange(rng.uniform(0.0, step), ends[-1], step)
        number = np.searchsorted(ends, t, side="right") - 1
        share = np.minimum((t - ends[number]) / time[number], 1.0)
        way = 0.5 * (1.0 - np.cos(np.pi * share)) if gentle else share
        x = np.round(20.0 * np.where(number % 2 == 0, way, 1.0 - way), 3)
        found = read_motion(x, turn_threshold(x), noise_sd(x)).branch
        wrong.append(np.count_nonzero(found != np.where(number % 2 == 0, -1, 1)))
    assert np.mean(wrong) / 5 < 0.3


def test_fast_strokes_between_long_holds() -> None:
    """Of 14 rows each between holds of 400: in means of a hold's rows they must not be lost."""
    for rows, hold in ((14, 400), (8, 1500), (30, 250)):
        way = np.concatenate([(np.arange(rows) + 0.4) / rows, np.ones(hold)])
        x = 5.556 * np.concatenate([way, 1.0 - way] * 3)
        truth = np.repeat([-1, 1] * 3, rows + hold)
        found = read_motion(x, turn_threshold(x), noise_sd(x))
        assert (found.branch == truth)[~found.unclear].all()
        assert found.unclear.sum() <= 6 * 3


def test_a_hold_ends_at_its_last_row_however_the_encoder_rustles() -> None:
    """Reached and left halfway between two rows at full speed; noise of a ten-thousandth of the stroke.

    Of two rows beside a hold's end and a little more none is wrong without being known as unclear.
    """
    rng = np.random.default_rng(5)
    unclear = 0
    for _ in range(20):
        strokes, truth = [], []
        for number, rows in enumerate(np.repeat(rng.integers(9, 16) * np.array([1, 5, 1]), 2)):
            way = np.concatenate([(np.arange(rows) + 0.5) / rows, np.ones(20)])
            strokes.append(27.0 * (way if number % 2 == 0 else 1.0 - way))
            truth.append(np.full(len(way), -1 if number % 2 == 0 else 1))
        x = np.concatenate(strokes)
        x = np.round(x + 0.0027 * rng.normal(size=len(x)), 4)
        found = read_motion(x, turn_threshold(x), noise_sd(x))
        assert (found.branch == np.concatenate(truth))[~found.unclear].all()
        unclear += int(found.unclear.sum())
    assert unclear <= 2.5 * 20 * 5


@pytest.mark.parametrize("encoder", [0.0, 1e-4, 1e-3])
@pytest.mark.parametrize("shape", ["full speed", "gentle", "trapezoid"])
def test_a_few_strokes_too_fast_for_their_rows(shape: str, encoder: float) -> None:
    """Of 5 to 12 rows among slow ones of ten times as many: what they turn is no noise of the encoder.

    ``encoder`` is its sd in strokes. By a mean square it came out so large that readings of slow strokes
    had the branch of the fast one before (trapezoids fail this test by it).
    """
    rng = np.random.default_rng(7)
    wrong, unclear, strokes = 0, 0, 0
    for fast, pattern in [
        (r, p) for r in (5, 8, 12) for p in ((1, 1, 10, 1), (1, 10, 1, 10)) for _ in range(4)
    ]:
        rows = np.repeat(fast * np.array(pattern, dtype=float), 2)
        ends = np.concatenate([[0.0], np.cumsum(rows)])
        t = np.arange(rng.uniform(), ends[-1])
        number = np.searchsorted(ends, t, side="right") - 1
        share = (t - ends[number]) / rows[number]
        way = way_of(shape, share)
        x = 20.0 * (np.where(number % 2 == 0, way, 1.0 - way) + encoder * rng.standard_normal(len(t)))
        x = np.round(x, 4)
        misread, untold = rows_misread(x, number)
        wrong, unclear = wrong + misread, unclear + untold
        strokes += len(rows)
    assert wrong / strokes < 0.1
    assert unclear / strokes < 3.5


@pytest.mark.parametrize("quantum", [0.0, 0.001, 0.01, 0.05])
@pytest.mark.parametrize("shape", ["full speed", "gentle", "trapezoid"])
@pytest.mark.parametrize("hold", [0.0, 0.5, 4.0])
def test_rows_that_no_motion_tells_are_few_and_known(shape: str, hold: float, quantum: float) -> None:
    """Of all rows that are not unclear the branch is right; of a stroke's 20 to 200 rows up to three are.

    Most where it turns gently under a coarse encoder: those that cover less than a quantum or two.
    """
    rng = np.random.default_rng(4)
    wrong, unclear, strokes = 0, 0, 0
    for rows in (20, 60, 200) * 4:
        time, cycles = 10.0, 3
        step = time / rows
        t = np.arange(rng.uniform(0.0, step), 2 * cycles * (time + hold), step)
        number = np.minimum((t / (time + hold)).astype(int), 2 * cycles - 1)
        share = np.minimum((t - number * (time + hold)) / time, 1.0)
        way = way_of(shape, share)
        x = 20.0 * np.where(number % 2 == 0, way, 1.0 - way)
        x = np.round(x / quantum) * quantum if quantum else x
        misread, untold = rows_misread(x, number)
        wrong, unclear = wrong + misread, unclear + untold
        strokes += 2 * cycles
    assert wrong / strokes < 0.1
    assert unclear / strokes < (0.6 if shape == "full speed" and not hold else 3.5)


@pytest.mark.parametrize("fast", [1.0, 5.7])
@pytest.mark.parametrize("ramp", [2.5, 4.4, 9.0])
def test_a_crosshead_that_gathers_its_speed_in_a_few_rows_is_not_held(ramp: float, fast: float) -> None:
    """Slow cycles, then faster ones, up to speed in as many rows; noise of a ten-thousandth of the stroke."""
    rng = np.random.default_rng(6)
    wrong, unclear, strokes = 0, 0, 0
    for _ in range(10):
        # Each stroke at its pace: speed v is reached after `ramp` rows and lost in as many.
        paces = np.repeat([1.0, fast], 4) * 7.6 / 60.0
        durations = 7.6 / paces + ramp
        ends = np.concatenate([[0.0], np.cumsum(durations)])
        t = np.arange(rng.uniform(), ends[-1])
        number = np.searchsorted(ends, t, side="right") - 1
        since, left = t - ends[number], ends[number + 1] - t
        edge = np.minimum(np.minimum(since, left), ramp)
        way = np.where(since < left, 0.0, 7.6) + np.where(since < left, 1.0, -1.0) * paces[number] * (
            np.minimum(since, left) - edge + edge**2 / (2.0 * ramp)
        )
        x = np.where(number % 2 == 0, way, 7.6 - way) + 0.00076 * rng.standard_normal(len(t))
        misread, untold = rows_misread(x, number)
        wrong, unclear = wrong + misread, unclear + untold
        strokes += len(paces)
    assert wrong / strokes < 0.05
    assert unclear / strokes < 3.5


def rows_misread(x: np.ndarray, number: np.ndarray) -> tuple[int, int]:
    """Rows with a wrong branch, and rows that are unclear; strokes of even ``number`` contract."""
    found = read_motion(x, turn_threshold(x), noise_sd(x))
    wrong = (found.branch != np.where(number % 2 == 0, -1, 1)) & ~found.unclear
    return np.count_nonzero(wrong), np.count_nonzero(found.unclear)


def way_of(shape: str, share: np.ndarray) -> np.ndarray:
    """Share of a stroke's way after each share of its time."""
    return {
        "full speed": share,
        "gentle": 0.5 * (1.0 - np.cos(np.pi * share)),
        "trapezoid": np.interp(share, *trapezoid()),
    }[shape]


def trapezoid() -> tuple[np.ndarray, np.ndarray]:
    """Shares of a stroke's time and way that speeds up and slows down over an eighth of its time."""
    time = np.linspace(0.0, 1.0, 2001)
    speed = np.minimum(np.minimum(time, 1.0 - time) / 0.125, 1.0)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))])
    return time, way / way[-1]


def test_rows_before_the_first_motion_have_no_branch() -> None:
    x = np.concatenate([np.zeros(300), np.linspace(0.0, 10.0, 500)])
    found = read_motion(x, turn_threshold(x), noise_sd(x))
    assert (found.branch[:299] == 0).all() and (found.branch[302:] == -1).all()
    assert found.unclear[:299].all() and not found.unclear[302:].any()


def test_a_hold_in_mid_stroke_belongs_to_the_stroke() -> None:
    x = np.concatenate([np.linspace(0, 5, 300), np.full(200, 5.0), np.linspace(5, 10, 300)])
    x = x + 0.01 * np.random.default_rng(0).normal(size=len(x))
    assert (read_motion(x, turn_threshold(x), noise_sd(x)).branch == -1).all()


def test_noise_is_estimated_through_motion() -> None:
    x = loops(levels=(100.0,), cycles=3, encoder_sd=0.02, rate=100.0).displacement
    assert noise_sd(x) == pytest.approx(0.02, rel=0.1)


@given(
    st.lists(st.integers(-6, 6), min_size=2, max_size=60),
    st.integers(1, 5),
)
@settings(max_examples=300, deadline=None)
def test_turning_points_are_those_of_a_hysteresis_comparator(steps: list[int], threshold: int) -> None:
    values = np.cumsum(steps).astype(float)
    turns = turning_points(values, threshold)
    swings = np.diff(values[turns])
    assert (np.abs(swings) >= threshold).all()
    assert (np.sign(swings[1:]) == -np.sign(swings[:-1])).all()
    assert len(swings) == zigzag(list(values), threshold)


def test_turning_points_of_a_million_rows_of_chatter_take_few_passes() -> None:
    x = np.round(np.random.default_rng(0).normal(size=200_000))
    assert len(turning_points(x, 100.0)) == 1


def test_cycles_count_within_a_level() -> None:
    level = np.array([0, 0, 0, 0, 1, 1, 0, 0, 0])
    branch = np.array([-1, 1, -1, 1, 1, -1, 0, -1, 1])
    assert number_cycles(level, np.zeros(9, dtype=int), branch, np.zeros(9, dtype=int)).tolist() == [
        1,
        1,
        2,
        2,
        1,
        1,
        3,
        3,
        3,
    ]


def test_one_stroke_in_each_file_still_makes_a_cycle() -> None:
    zeros = np.zeros(4, dtype=int)
    clock = np.array([0, 1, 2, 3])
    assert number_cycles(zeros, clock, np.array([-1, 1, -1, 1]), zeros).tolist() == [1, 1, 2, 2]
    assert number_cycles(zeros, clock, np.array([-1, -1, 1, 1]), zeros).tolist() == [1, 2, 2, 3]


def test_cycles_begin_at_the_turn_beside_them() -> None:
    """Where branches are read off the motion a cycle's number may change two rows off; farther it stays."""
    branch = np.repeat([-1, 1, -1, 1], 10)
    run = np.zeros(40, dtype=np.int64)
    for change, expected in ((18, 20), (20, 20), (22, 20), (24, 24)):
        cycle = np.where(np.arange(40) < change, 1, 2)
        moved = cycles_at_turns(cycle, run, branch)
        assert moved.tolist() == [1] * expected + [2] * (40 - expected)
    apart = np.repeat([0, 1], 20)  # another level: its numbers are its own
    cycle = np.where(np.arange(40) < 20, 2, 1)
    assert cycles_at_turns(cycle, apart, branch).tolist() == cycle.tolist()
