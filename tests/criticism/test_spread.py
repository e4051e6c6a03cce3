"""Workers that hold a problem: one that is killed is not waited for."""

from __future__ import annotations

import os
import signal
import time

import pytest
from rig import sets
from threadpoolctl import threadpool_info, threadpool_limits

from criticism.cases import problem_of, specimen_of
from mpam_calib.criticism.fitting.refits import best_of
from mpam_calib.criticism.tasks import spread as module
from mpam_calib.criticism.tasks.spread import Alone, held_problem, spread_over
from mpam_calib.errors import Interrupted


def rows_held(number: int) -> int:
    """Rows of the problem that this process holds; a process that is given 0 dies as for want of memory."""
    if number == 0:
        os.kill(os.getpid(), signal.SIGKILL)
    return len(held_problem()) * number


def threads(_number: int) -> int:
    """BLAS threads of this process, at most."""
    return max((library["num_threads"] for library in threadpool_info()), default=1)


def test_workers_have_one_thread_each() -> None:
    """Whatever the caller's own limit: two threads in each of two workers took three times as long."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null")
    problem = problem_of(specimen_of(recipe.name))
    with threadpool_limits(2):
        assert threads(0) == 2
        with spread_over(problem, 2) as spread:
            assert list(spread(threads, range(4))) == [1, 1, 1, 1]


def test_a_killed_worker_ends_the_work() -> None:
    recipe = next(r for r in sets.recipes("develop") if r.group == "null")
    problem = problem_of(specimen_of(recipe.name))
    with spread_over(problem, 2) as spread:
        assert list(spread(rows_held, [1, 2, 3])) == [len(problem) * k for k in (1, 2, 3)]
    with pytest.raises(Interrupted, match="killed"), spread_over(problem, 2) as spread:
        list(spread(rows_held, [0, 1, 2]))


def test_nobody_waits_for_running_tasks_of_an_interrupted_search() -> None:
    """What was returned before is there; the rest is killed."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null")
    problem = problem_of(specimen_of(recipe.name))
    start, seen = time.monotonic(), []
    with pytest.raises(KeyboardInterrupt), spread_over(problem, 2) as spread:
        for slept in spread(sleep, [0.0, 60.0, 60.0, 60.0]):
            seen.append(slept)
            raise KeyboardInterrupt
    assert seen == [0.0]
    assert time.monotonic() - start < 20.0


def sleep(seconds: float) -> float:
    """A long task, which no Ctrl-C of a terminal ends."""
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(seconds)
    return seconds


def test_processes_that_begin_afresh_do_the_same_work(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no process can be forked, as on Windows, the problem and its model's effects are sent."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null")
    problem = problem_of(specimen_of(recipe.name))
    forms = ("creep:bent", "presliding")
    tasks = [(size, [(forms, {})], False) for size in (0, 2)]
    here = list(Alone(problem)(best_of, tasks))
    monkeypatch.setattr(module, "start_method", lambda: "spawn")
    with spread_over(problem, 2) as spread:
        there = list(spread(best_of, tasks))
    assert all(f is not None and f.effects == set(forms) for f in here)
    assert [f.log_evidence for f in there if f] == pytest.approx([f.log_evidence for f in here if f])
