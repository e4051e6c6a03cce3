"""Beside structure that no set removes a history stands only where strokes have it in common."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from criticism.found import search
from mpam_calib.criticism.verdict import Verdict, judge
from mpam_calib.specimen.recording import Loops

from .cases import problem_of, specimen_of

HISTORIES = ("creep", "stress_softening", "force_drift")
Array = NDArray[np.float64]


def judged(name: str, off: Callable[[Loops], Array], tested: tuple[str, ...] = HISTORIES) -> Verdict:
    """The verdict on a rig's null whose readings are replaced."""
    specimen = specimen_of(name)
    loops = specimen.loops
    assert loops is not None
    problem = problem_of(replace(specimen, loops=replace(loops, force_N=off(loops))))
    return judge(search(problem, tested))


@pytest.mark.long
def test_a_gain_that_swings_is_no_history() -> None:
    """By 5 % along the test, as a room warms up and cools down: creep that bends follows some of the way."""

    def swung(loops: Loops) -> Array:
        share = (loops.time_s - loops.time_s[0]) / np.ptp(loops.time_s)
        return loops.force_N * (1.0 + 0.05 * np.sin(2.0 * np.pi * 5.07 * share + 5.7))

    verdict = judged("develop-null-007", swung)
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset())


def test_a_history_stands_beside_a_ripple_along_the_stroke() -> None:
    """Relaxation at every level, whatever else is off at the same places in all strokes."""

    def relaxed(loops: Loops) -> Array:
        begin = np.array([loops.time_s[loops.level == i].min() for i in range(loops.level.max() + 1)])
        decades = np.log10(1.0 + loops.time_s - begin[loops.level])
        ripple = np.sin(2.0 * np.pi * 5.0 * loops.displacement_m / loops.displacement_m.max())
        return loops.force_N * (1.0 - 0.1 * decades) + 0.01 * loops.force_N.max() * ripple

    verdict = judged("develop-null-001", relaxed)
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset({"creep"}))


@pytest.mark.long
def test_a_name_that_explains_less_than_is_left_does_not_stand() -> None:
    """A crosshead that rings after every turn: friction that turns over late follows a little of it."""

    def rung(loops: Loops) -> Array:
        first, rows = loops.strokes
        since = loops.time_s - np.repeat(loops.time_s[first], rows)
        lasts = np.median(since[first + rows - 1])
        ring = np.exp(-4.0 * since / lasts) * np.cos(80.0 * since / lasts) * np.sign(loops.branch)
        return loops.force_N - 0.02 * loops.force_N.max() * ring

    verdict = judged("develop-null-001", rung, ("presliding", *HISTORIES))
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset())
