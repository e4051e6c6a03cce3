"""Clocks with fewer digits than the readings need, and times that repeat by mistake."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import blocks, clock, read
from mpam_calib.specimen.clock import Usual, spread_ticks, usual_tick

from .folders import Recording, loops, make

EVERY, TICK = 0.02, 0.1
"""Seconds between readings, and to which the coarse clock is written."""


def recording() -> Recording:
    return loops((50.0, 100.0, 150.0), cycles=2, rate=1.0 / EVERY, pressure_sd=0.2)


def on_ticks(made: Recording) -> Recording:
    return replace(made, time=np.floor(made.time / TICK + 1e-6) * TICK)


def test_readings_of_a_tick_are_spread_over_it() -> None:
    time = np.array([1.0, 1.0, 2.0, 3.0, 3.0, 3.0, 3.0])
    usual = Usual(1.0, 0.5)
    assert spread_ticks(time, 5.0, usual).tolist() == [1.0, 1.5, 2.0, 3.0, 3.5, 4.0, 4.5]
    assert spread_ticks(time[1:4], 4.0, usual).tolist() == [1.0, 2.0, 3.0]


def test_readings_before_a_pause_are_not_spread_over_it() -> None:
    """A late buffer that holds as many readings more is no pause."""
    pause = np.array([0.0, 0.0, 1.0, 1.0, 60.0, 60.0, 61.0])
    late = np.array([0.0, 0.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 5.0, 5.0, 6.0])
    assert usual_tick(pause) == usual_tick(late) == Usual(1.0, 0.5)
    assert spread_ticks(pause, 62.0, usual_tick(pause)).tolist() == [0.0, 0.5, 1.0, 1.5, 60.0, 60.5, 61.0]
    assert np.diff(spread_ticks(late, 7.0, usual_tick(late)))[:-1] == pytest.approx(0.5)


@pytest.mark.parametrize("size", [blocks.BLOCK_BYTES, 1 << 10])
@pytest.mark.parametrize("rows", [clock.FIRST, 200])
def test_a_pause_on_a_coarse_clock_stays_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int, rows: int
) -> None:
    """Also behind the last tick but one, and wherever blocks end."""
    monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
    monkeypatch.setattr(clock, "FIRST", rows)
    made = recording()
    later = np.searchsorted([len(made.time) // 3, len(made.time) - 3], np.arange(len(made.time)), "right")
    paused = replace(made, time=made.time + 60.03 * later)
    found = read(make(tmp_path, loops=on_ticks(paused).text())).loops
    assert found is not None
    assert found.time_s == pytest.approx(paused.time, abs=TICK)


@pytest.mark.parametrize("size", [blocks.BLOCK_BYTES, 1 << 10])
def test_a_coarse_clock_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, size: int) -> None:
    """In one block, and where blocks end within ticks."""
    monkeypatch.setattr(blocks, "BLOCK_BYTES", size)
    made = recording()
    fine = read(make(tmp_path / "fine", loops=made.text())).loops
    specimen = read(make(tmp_path / "coarse", loops=on_ticks(made).text()))
    coarse = specimen.loops
    assert fine is not None and coarse is not None
    assert coarse.time_s == pytest.approx(fine.time_s, abs=EVERY / 2)
    assert np.all(np.diff(coarse.time_s) > 0.0)
    assert coarse.stroke.tolist() == fine.stroke.tolist()
    (note,) = [note for note in specimen.notes if "evenly spaced" in note]
    share = 1.0 - TICK**-1 * EVERY
    assert f"of {len(made.time)} readings" in note
    assert int(note.split()[1]) == pytest.approx(share * len(made.time), abs=5)


def test_rows_written_twice_are_refused(tmp_path: Path) -> None:
    lines = recording().text().splitlines()
    twice = [lines[0], *(line for line in lines[1:] for _ in range(2))]
    folder = make(tmp_path, loops="\n".join(twice) + "\n")
    with pytest.raises(InputError, match=r"loops\.csv:3:time_s: .*again"):
        read(folder)


@pytest.mark.parametrize("time", [0.0, 17.5])
def test_a_clock_that_stands_still_is_refused(tmp_path: Path, time: float) -> None:
    made = recording()
    folder = make(tmp_path, loops=replace(made, time=np.full(len(made.time), time)).text())
    with pytest.raises(InputError, match=rf"loops\.csv:time_s: found {time:g} in every row"):
        read(folder)


def test_a_single_repeat_and_a_step_back_are_refused(tmp_path: Path) -> None:
    made = recording()
    again, back = made.time.copy(), made.time.copy()
    again[40], back[-1] = again[39], back[-2] - 0.005
    for number, (time, words) in enumerate(((again, "again"), (back, "a step back"))):
        folder = make(tmp_path / str(number), loops=replace(made, time=time).text())
        row = 42 if words == "again" else len(time) + 1
        with pytest.raises(InputError, match=rf"loops\.csv:{row}:time_s: .*{words}"):
            read(folder)


def test_the_last_tick_is_as_long_as_the_one_before_it(tmp_path: Path) -> None:
    made = recording()
    whole = len(made.time) // 5 * 5
    made = Recording(*(column[:whole] for column in vars(made).values()))
    found = read(make(tmp_path, loops=on_ticks(made).text())).loops
    assert found is not None
    assert np.diff(found.time_s)[-4:] == pytest.approx(np.full(4, EVERY))
