"""A displacement that stands still while the force goes on is asked about; what only looks like it is not."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mpam_calib.specimen import read
from mpam_calib.specimen.sticking import between_jumps, sticking, under_way

from .folders import Recording, loops, make

Array = NDArray[np.float64]
Change = Callable[[Recording], Recording]


def asked(folder: Path, recording: Recording) -> list[str]:
    found = read(make(folder, loops=recording.text())).loops
    assert found is not None
    return sticking(found)


def read_every(rows: int) -> Change:
    """A gauge that is asked anew only every so many rows."""

    def change(made: Recording) -> Recording:
        return replace(made, displacement=made.displacement[np.arange(len(made.time)) // rows * rows])

    return change


def stuck(first: int, rows: int) -> Change:
    def change(made: Recording) -> Recording:
        x = made.displacement.copy()
        x[first : first + rows] = x[first]
        return replace(made, displacement=x)

    return change


def waits(rows: int, every: int, relaxes: float) -> Change:
    """A crosshead that steps and waits, while the force goes back by a share of its last change."""

    def change(made: Recording) -> Recording:
        kept = np.arange(0, len(made.time), every)
        at = np.repeat(kept, rows)
        force = made.force[kept]
        late = np.exp(-3.0 * np.tile(np.arange(rows), len(kept)) / rows)
        over = relaxes * np.repeat(np.diff(force, prepend=force[0]), rows) * late
        columns = (made.pressure, made.displacement, made.force, made.branch, made.cycle)
        new = Recording(np.arange(len(at)) / 10.0, *(column[at] for column in columns))
        return replace(new, force=new.force + over)

    return change


def rests(first: int, rows: int) -> Change:
    """A crosshead that rests in the midst of a stroke; the force relaxes by a tenth."""

    def change(made: Recording) -> Recording:
        at = np.sort(np.concatenate([np.arange(len(made.time)), np.full(rows, first)]))
        columns = (made.pressure, made.displacement, made.force, made.branch, made.cycle)
        new = Recording(np.arange(len(at)) / 10.0, *(column[at] for column in columns))
        here = np.flatnonzero(at == first)
        relaxed = new.force.copy()
        relaxed[here] *= 1.0 - 0.1 * (1.0 - np.exp(-4.0 * np.arange(len(here)) / rows))
        return replace(new, force=relaxed)

    return change


def with_its_noise(made: Recording) -> Recording:
    """A coarse ruler behind an amplifier: 2 % of a mark."""
    noise = 0.005 * np.random.default_rng(3).standard_normal(len(made.time))
    return replace(made, displacement=np.round(4.0 * made.displacement) / 4.0 + noise)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (read_every(3), "stands for about 3 readings and then jumps by 0.24 mm, while the force goes on"),
        (read_every(7), "stands for about 7 readings and then jumps by 0.56 mm"),
        (stuck(30, 25), "for 25 readings from 3 s after the first one on, while the force changes by"),
    ],
)
def test_a_gauge_that_sticks_is_asked_about(tmp_path: Path, change: Change, words: str) -> None:
    found = asked(tmp_path, change(loops(cycles=2)))
    assert len(found) == 1
    assert words in found[0]
    assert found[0].endswith("?")


@pytest.mark.parametrize(
    "change",
    [
        lambda made: made,
        with_its_noise,
        waits(12, 6, 0.15),
        waits(12, 6, 0.6),
        rests(40, 60),
        rests(40, 400),
    ],
)
def test_what_only_looks_like_it_is_not(tmp_path: Path, change: Change) -> None:
    assert asked(tmp_path, change(loops(cycles=2))) == []


@pytest.mark.parametrize("quantum", [0.01, 0.1, 0.37, 1.0])
@pytest.mark.parametrize("speed", [0.02, 0.8])
def test_nor_is_a_coarse_ruler(tmp_path: Path, quantum: float, speed: float) -> None:
    """Whatever the crosshead's speed: it stands at the marks, and goes from one to the next."""
    assert asked(tmp_path, loops(levels=(100.0, 150.0), speeds=(speed,), dwell=30, quantum=quantum)) == []


def test_nor_is_what_no_force_tells(tmp_path: Path) -> None:
    """A cylinder pulls alike all along its stroke: whether the force goes on cannot be seen."""
    made = read_every(3)(loops(cycles=2))
    noise = 0.02 * np.random.default_rng(1).standard_normal(len(made.time))
    assert asked(tmp_path, replace(made, force=0.3 * made.pressure + noise)) == []


def test_a_few_glitches_of_a_slow_crosshead_are_no_jumps(tmp_path: Path) -> None:
    """All other steps are small beside them, and yet make the way."""
    made = loops(levels=(100.0, 150.0), speeds=(0.1,))
    x = made.displacement.copy()
    for row in range(150, len(x), 200):
        x[row:] += 0.2 if made.branch[row] < 0 else -0.2
    found = read(make(tmp_path, loops=replace(made, displacement=x).text())).loops
    assert found is not None
    assert between_jumps(found, under_way(found)).tolist() == [1, 1, 1, 1]
    assert sticking(found) == []


def test_a_force_that_goes_back_while_the_crosshead_waits_does_not_go_on(tmp_path: Path) -> None:
    found = read(make(tmp_path, loops=waits(12, 6, 0.6)(loops(cycles=2)).text())).loops
    assert found is not None
    assert set(between_jumps(found, under_way(found)).tolist()) == {1}


def test_check_asks_about_it_without_scipy(tmp_path: Path) -> None:
    make(tmp_path, loops=read_every(3)(loops(cycles=2)).text())
    code = (
        "import sys; from mpam_calib.cli import main; sys.argv[1:] = ['check', sys.argv[1]]\n"
        "try: main()\n"
        "finally: print('scipy' in sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path)], capture_output=True, text=True, check=False
    )
    assert "does the gauge stick" in done.stdout
    assert done.stdout.splitlines()[-1] == "False"
