"""What an interrupted search or ranking has done is read, not done again, and the result is the same."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from criticism.cases import problem_of, specimen_of
from criticism.found import search
from mpam_calib.criticism.searching.searched import Search, best_first
from mpam_calib.criticism.selection.select import Selection, select
from mpam_calib.criticism.tasks import journal as module
from mpam_calib.criticism.tasks.journal import Journal
from mpam_calib.posterior.chains.checkpoint import Checkpoint


@dataclass
class Worker:
    """Squares numbers, and is killed at some."""

    deadly: int = -1
    seen: list[int] = field(default_factory=list)

    def __call__(self, number: int) -> float:
        if number == self.deadly:
            raise KeyboardInterrupt
        self.seen.append(number)
        return float(number * number)


def here(function: Callable[[Any], Any], tasks: Iterable[Any], chunk: int = 1) -> Iterator[Any]:
    return map(function, tasks)


@dataclass(frozen=True)
class Full(Checkpoint):
    """A disk on which there is room for so many parts."""

    room: int = 0

    def save(self, name: str, part: Any) -> None:
        if len(list(self.folder.glob("*"))) >= self.room:
            raise KeyboardInterrupt
        super().save(name, part)


def test_only_what_is_left_is_done(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "EVERY", -1.0)
    checkpoint = Checkpoint(tmp_path / "parts", "digest")
    first = Worker(deadly=12)
    spread = Journal(checkpoint).over(here)
    assert list(spread(first, range(3))) == [0.0, 1.0, 4.0]
    with pytest.raises(KeyboardInterrupt):
        list(spread(first, range(10, 14)))
    again = Worker()
    spread = Journal(checkpoint).over(here)
    assert list(spread(again, range(3))) == [0.0, 1.0, 4.0]
    assert list(spread(again, range(10, 14))) == [100.0, 121.0, 144.0, 169.0]
    assert again.seen == [12, 13]
    # Once more, now that a part was written after an interruption.
    spread = Journal(checkpoint).over(here)
    last = Worker()
    assert [list(spread(last, range(3))), list(spread(last, range(10, 14)))][1][-1] == 169.0
    assert last.seen == []


def test_another_digest_starts_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "EVERY", -1.0)
    list(Journal(Checkpoint(tmp_path, "before")).over(here)(Worker(), range(5)))
    for _ in range(2):
        worker = Worker()
        spread = Journal(Checkpoint(tmp_path, "after")).over(here)
        assert list(spread(worker, range(3))) == [0.0, 1.0, 4.0]
    assert worker.seen == []


def test_parts_of_several_attempts_fit_together(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """How many tasks a part holds depends on the clock, and another digest's parts may have come between."""
    monkeypatch.setattr(module, "EVERY", -1.0)
    for digest, deadly in (("a", 9), ("b", 5), ("a", 3)):
        with pytest.raises(KeyboardInterrupt):
            list(Journal(Checkpoint(tmp_path, digest)).over(here)(Worker(deadly), range(12)))
    monkeypatch.setattr(module, "EVERY", 100.0)
    for digest in ("a", "b", "a"):
        found = list(Journal(Checkpoint(tmp_path, digest)).over(here)(Worker(), range(12)))
        assert found == [float(n * n) for n in range(12)]


def test_without_room_nothing_is_kept_and_the_work_goes_on(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("no folder")
    spread = Journal(Checkpoint(tmp_path / "file" / "parts", "digest")).over(here)
    assert list(spread(Worker(), range(3))) == [0.0, 1.0, 4.0]


def test_sets_that_tie_have_one_order_in_every_process() -> None:
    sets = [frozenset(s) for s in (("presliding", "dead_band"), ("dead_band", "rate_friction"), ("creep",))]
    assert best_first(set(sets), lambda s: 0.0) == [sets[2], sets[0], sets[1]]
    assert best_first(set(sets), lambda s: float("dead_band" in s)) == [sets[0], sets[1], sets[2]]


def test_a_search_goes_on_where_it_was_interrupted(tmp_path: Path) -> None:
    problem = problem_of(specimen_of("develop-null-001"))
    tested = ("creep", "dead_band", "length_offset")

    def told(journal: Journal | None) -> Search:
        return search(problem, tested, journal=journal)

    whole = told(None)
    with pytest.raises(KeyboardInterrupt):
        told(Journal(Full(tmp_path, "digest", room=7)))
    times = {p: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    assert len(times) == 7
    resumed = told(Journal(Checkpoint(tmp_path, "digest")))
    assert {p: p.stat().st_mtime_ns for p in times} == times
    assert resumed.sets == whole.sets
    assert resumed.fits.keys() == whole.fits.keys()
    for key, fit in whole.fits.items():
        assert resumed.fits[key].effects == fit.effects
        assert resumed.fits[key].log_evidence == fit.log_evidence
        np.testing.assert_array_equal(resumed.fits[key].covariance, fit.covariance)


def test_a_ranking_comes_back_from_its_journal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All that ranking, integrating, bridging, holding out and telling apart return can be kept."""
    from mpam_calib.criticism.selection import select as selecting

    specimen = specimen_of("develop-null-001")
    few = [specimen.simulation.model_copy(update={"order": order}) for order in (1, 2)]
    monkeypatch.setattr(selecting, "model_space", lambda specimen: few)

    def told(journal: Journal | None) -> Selection:
        return select(specimen, replicates=1, workers=1, journal=journal)

    whole = told(Journal(Checkpoint(tmp_path, "digest")))
    times = {p: p.stat().st_mtime_ns for p in tmp_path.iterdir()}
    again = told(Journal(Checkpoint(tmp_path, "digest")))
    assert {p: p.stat().st_mtime_ns for p in tmp_path.iterdir()} == times
    for name in ("models", "odds", "levels", "sensitivity"):
        assert getattr(again, name).equals(getattr(whole, name)), name
    np.testing.assert_array_equal(again.confusion, whole.confusion)
