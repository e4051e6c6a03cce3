"""Worker processes that hold one target: sent once, used for climbs and for ensembles."""

from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Protocol, TypeVar

from threadpoolctl import threadpool_limits

from mpam_calib.errors import Interrupted
from mpam_calib.posterior.density.collapsed import Collapsed

Task = TypeVar("Task")
Found = TypeVar("Found")
Held = TypeVar("Held")

_TARGET: Collapsed | None = None


def held_target() -> Collapsed:
    """The target of this worker."""
    assert _TARGET is not None
    return _TARGET


def _adopt(target: Collapsed) -> None:
    """Prepare a worker."""
    global _TARGET
    _TARGET = target
    ignore_interrupts()
    settle_worker()


def ignore_interrupts() -> None:
    """Ctrl-C is for the parent, which decides."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def start_method() -> str:
    """How processes begin: forked, or afresh where the system knows no fork."""
    return "fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn"


def settle_worker() -> None:
    """Let a worker process do its work by itself, and die with its parent."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)
        # A parent that was killed before this line will send nothing any more.
        parent = multiprocessing.parent_process()
        if parent is not None and os.getppid() != parent.pid:
            os._exit(1)
        _keep_freed_memory()
    # One thread each: the work is parallel already, and sums must not depend on the machine.
    threadpool_limits(1)


def _keep_freed_memory() -> None:
    """Let glibc use freed arrays again: asking for new pages took a third of a likelihood."""
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except AttributeError:  # another C library
        return
    trim_threshold, mmap_threshold = -1, -3
    mallopt(mmap_threshold, 1 << 30)
    mallopt(trim_threshold, 1 << 30)


class Workers(Protocol):
    """Processes that hold the target."""

    def map(self, work: Callable[[Task], Found], tasks: Iterable[Task]) -> list[Found]:
        """The results in the tasks' order."""


def results(
    executor: ProcessPoolExecutor, work: Callable[[Task], Found], tasks: Iterable[Task]
) -> Iterator[Found]:
    """The results in the tasks' order; all tasks are handed out at once.

    Not the executor's own map: when interrupted it cancels what waits, and a future cancelled while a worker
    is killed ends the executor's thread with a traceback.
    """
    waiting = [executor.submit(work, task) for task in tasks]
    return (each.result() for each in waiting)


class Inline:
    """What stands for processes inside another pool's worker, which may have none of its own."""

    def map(self, work: Callable[[Task], Found], tasks: Iterable[Task]) -> list[Found]:
        """One task after the other, here."""
        return [work(task) for task in tasks]


@dataclass(frozen=True)
class Processes:
    """Processes of our own; one that is killed ends the computation instead of being waited for."""

    executor: ProcessPoolExecutor

    def map(self, work: Callable[[Task], Found], tasks: Iterable[Task]) -> list[Found]:
        """All tasks at once; raises ``Interrupted`` where a process is killed."""
        try:
            return list(results(self.executor, work, tasks))
        except BrokenProcessPool as error:
            raise Interrupted(
                "interrupted: a worker process was killed (for want of memory?); what was drawn is kept, the "
                "same command goes on from it"
            ) from error


@contextmanager
def workers(target: Collapsed, wanted: int) -> Iterator[Workers]:
    """At most ``wanted`` workers that hold the target."""
    global _TARGET
    if multiprocessing.current_process().daemon:
        before, _TARGET = _TARGET, target
        try:
            yield Inline()
        finally:
            _TARGET = before
        return
    count = max(1, min(wanted, os.cpu_count() or 1))
    with executor_of(count, start_method(), _adopt, target) as executor:
        yield Processes(executor)


@contextmanager
def executor_of(
    count: int, method: str, begin: Callable[[Held], None], held: Held
) -> Iterator[ProcessPoolExecutor]:
    """Processes that each ``begin`` with what they hold; killed, not waited for, where anything is raised."""
    others = set(multiprocessing.active_children())
    context = multiprocessing.get_context(method)
    with ProcessPoolExecutor(count, mp_context=context, initializer=begin, initargs=(held,)) as executor:
        try:
            yield executor
        except BaseException:
            # Nobody waits for what they are at.
            for child in set(multiprocessing.active_children()) - others:
                child.kill()
            _let_go(executor)
            raise


def _let_go(executor: ProcessPoolExecutor) -> None:
    """End the results of workers that were killed: the rest of one half sent would be waited for for ever.

    The executor reads until the last end to write to is closed, and one of them is its own.
    """
    with suppress(AttributeError, OSError):  # another Python's executor
        executor._result_queue._writer.close()  # type: ignore[attr-defined]
