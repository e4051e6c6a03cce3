"""Killed and interrupted runs: nothing is lost, nothing is left running, the result is the same."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from .command import (
    PATIENCE,
    Result,
    all_gone,
    contents,
    finish,
    kill,
    living,
    run,
    stamps,
    start,
    wait_for,
)

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="signals and /proc as Linux has them")

BLOCKS = 12
MANY_BLOCKS = ("--no-correlated-noise", "--no-remainder", "--ess", 1e6, "--max-steps", 40 * BLOCKS)
"""They stop at the budget, so that every run has as many blocks."""
ENDLESS = (*MANY_BLOCKS[:-1], 100_000)
"""The same blocks, and no end before a run is broken: a fast machine could otherwise be done by then."""
TABLES = ("summary.csv", "bands.csv", "run.json")


@pytest.fixture(scope="module")
def unbroken(muscle: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, bytes], float]:
    """What an uninterrupted run leaves, and the seconds that it took."""
    folder = tmp_path_factory.mktemp("unbroken") / "run"
    begin = time.monotonic()
    assert run("calibrate", muscle, "-o", folder, *MANY_BLOCKS).code == 3
    return contents(folder), time.monotonic() - begin


def resume(muscle: Path, folder: Path, whole: dict[str, bytes]) -> None:
    """Finish a broken run and compare it with the uninterrupted one."""
    result = run("calibrate", muscle, "-o", folder, *MANY_BLOCKS)
    assert (result.code, result.unremarked) == (3, "")
    after = contents(folder)
    assert set(after) == set(whole)
    for name in TABLES:
        assert after[name] == whole[name], name


@pytest.mark.long
def test_a_run_killed_twice_and_stopped_by_ctrl_c_ends_as_if_nothing_had_been(
    muscle: Path, tmp_path: Path, unbroken: tuple[dict[str, bytes], float]
) -> None:
    whole, seconds = unbroken
    folder = tmp_path / "run"
    written: dict[Path, int] = {}
    workers: list[int] = []
    for stage in range(3):
        process = start("calibrate", muscle, "-o", folder, *ENDLESS)
        # A part that is not there yet: once it is, this process is at work, and not still starting.
        assert wait_for(process, next(part for part in _parts(folder) if not part.exists()))
        workers.append(len(living(process.pid)) - 1)
        # Gone on with, not drawn anew.
        assert {path: path.stat().st_mtime_ns for path in written} == written
        if stage == 2:
            # As a terminal does: to the workers as well.
            os.killpg(process.pid, signal.SIGINT)
            result = finish(process)
            assert result.code == 130, result
            assert result.complaint.startswith("interrupted")
        else:
            time.sleep(0.03 * seconds * random.random())
            kill(process)
        assert all_gone(process.pid)
        assert not (folder / "run.json").exists()
        written = {part: part.stat().st_mtime_ns for part in _parts(folder) if part.exists()}
    assert max(workers) > 0  # between the stages there may be none
    resume(muscle, folder, whole)
    assert {path: path.stat().st_mtime_ns for path in written} == written


def _parts(folder: Path) -> list[Path]:
    """The checkpoint's parts in the order in which they are written."""
    names = ("warm_up", *(f"block_{number:05d}" for number in range(BLOCKS)))
    return [folder / "checkpoint" / f"{name}.checkpoint" for name in names]


@pytest.mark.long
@pytest.mark.parametrize("number", range(10))
def test_a_run_killed_at_any_moment_is_resumed(
    number: int, muscle: Path, tmp_path: Path, unbroken: tuple[dict[str, bytes], float]
) -> None:
    whole, seconds = unbroken
    folder = tmp_path / "run"
    process = start("calibrate", muscle, "-o", folder, *MANY_BLOCKS)
    time.sleep(seconds * random.uniform(0.1, 1.1))
    kill(process)
    assert all_gone(process.pid)
    resume(muscle, folder, whole)


LATE = """
import multiprocessing, time
from mpam_calib.posterior.density.pool import settle_worker

def work():
    time.sleep(1.0)
    settle_worker()
    time.sleep(100.0)

multiprocessing.get_context("fork").Process(target=work).start()
print("started", flush=True)
time.sleep(100.0)
"""


def test_a_worker_whose_parent_was_killed_before_it_began_ends() -> None:
    """In the moment between its fork and its first line it does not yet die with its parent."""
    process = subprocess.Popen(
        [sys.executable, "-c", LATE], stdout=subprocess.PIPE, text=True, start_new_session=True
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "started\n"
    kill(process)
    assert living(process.pid)
    assert all_gone(process.pid, 30.0)


def test_a_killed_worker_ends_the_run_and_keeps_what_was_drawn(muscle: Path, tmp_path: Path) -> None:
    """As the kernel does where memory runs out: nobody waits for what will never come."""
    folder = tmp_path / "run"
    process = start("calibrate", muscle, "-o", folder, *ENDLESS)
    assert wait_for(process, _parts(folder)[1])
    worker = next(pid for pid in living(process.pid) if pid != process.pid)
    os.kill(worker, signal.SIGKILL)
    result = finish(process)
    assert result.code == 130, result
    assert result.complaint.startswith("interrupted: a worker process was killed")
    assert all_gone(process.pid, PATIENCE)
    assert _parts(folder)[1].exists()


@pytest.mark.parametrize("delay", [0.4, 1.5])
def test_ctrl_c_at_an_early_moment_says_one_line(delay: float, muscle: Path, tmp_path: Path) -> None:
    result = _interrupt(muscle, tmp_path / "run", delay)
    assert result.code == 130, result
    assert result.complaint.startswith("interrupted")


@pytest.mark.long
@pytest.mark.parametrize("number", range(20))
def test_ctrl_c_at_any_moment_says_one_line(number: int, muscle: Path, tmp_path: Path) -> None:
    result = _interrupt(muscle, tmp_path / "run", random.uniform(0.3, 6.0))
    assert result.code in (130, 3), result
    if result.code == 130:
        assert result.complaint.startswith("interrupted")


def _interrupt(muscle: Path, folder: Path, delay: float) -> Result:
    process = start("calibrate", muscle, "-o", folder, *MANY_BLOCKS)
    time.sleep(delay)
    os.killpg(process.pid, signal.SIGINT)
    result = finish(process)
    assert all_gone(process.pid, PATIENCE)
    return result


STOPPED_IN_EXEC = """
import os, signal, sys
from mpam_calib.cli import CtrlC
signal.signal(signal.SIGINT, CtrlC())
try:
    exec("os.kill(os.getpid(), signal.SIGINT)\\nwhile True: pass")
except KeyboardInterrupt:
    sys.exit(130)
"""


def test_ctrl_c_while_a_class_is_made_keeps_the_exit_code(tmp_path: Path) -> None:
    (tmp_path / "stopped.py").write_text(STOPPED_IN_EXEC)
    command = [sys.executable, "-m", "stopped"]
    result = subprocess.run(command, capture_output=True, timeout=60, check=False, cwd=tmp_path)
    assert (result.returncode, result.stderr) == (130, b"")


LOST = """
import os, signal, sys
import mpam_calib.cli as cli
from mpam_calib.cli.progress import stage_progress
cli._ctrl_c = cli.CtrlC()
signal.signal(signal.SIGINT, cli._ctrl_c)
try:
    os.kill(os.getpid(), signal.SIGINT)
except KeyboardInterrupt:
    pass
with stage_progress() as tell:
    try:
        tell("searching", 0.5)
    except KeyboardInterrupt:
        sys.exit(130)
"""


def test_ctrl_c_that_got_lost_stops_at_the_next_progress() -> None:
    result = subprocess.run([sys.executable, "-c", LOST], capture_output=True, timeout=60, check=False)
    assert (result.returncode, result.stderr) == (130, b"")


@pytest.mark.long
def test_an_interrupted_diagnosis_goes_on(muscle: Path, tmp_path: Path) -> None:
    whole, broken = tmp_path / "whole", tmp_path / "broken"
    assert run("diagnose", muscle, "-o", whole).code == 0
    unfinished = broken / "unfinished"
    for stage, call in enumerate((2, 12)):  # the number of a call, as in the names of kept parts
        process = start("diagnose", muscle, "-o", broken)
        before = stamps(unfinished)
        assert wait_for(process, unfinished, f"{call:04d}_*")
        assert {name: stamps(unfinished)[name] for name in before} == before
        if stage == 0:
            kill(process)
            continue
        os.killpg(process.pid, signal.SIGINT)
        result = finish(process)
        assert result.code == 130, result
        assert result.complaint.startswith("interrupted: what was done is kept")
        assert not (broken / "diagnosis.json").exists()
    assert run("diagnose", muscle, "-o", broken).code == 0
    after = contents(broken)
    assert not unfinished.exists() and set(after) == set(contents(whole))
    assert after["diagnosis.json"] == (whole / "diagnosis.json").read_bytes()
