"""The screen of larger sets, in a world of straight lines where their exact refits are least squares."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mpam_calib.criticism.fitting.refits import Set
from mpam_calib.criticism.searching.screen import gain, promising

Array = NDArray[np.float64]
Columns = Callable[[Set], Array]

EFFECTS = tuple("abcdefgh")
TRUE = frozenset("abc")


def world(force: Array, columns: Columns, largest: int = 2) -> tuple[Any, dict[tuple[Set, int], Any]]:
    """A problem with white noise of 1 N and the refits of all sets up to the ``largest``."""
    problem = SimpleNamespace(force=force, white=lambda x, size: x)
    sets = [frozenset(s) for k in range(largest + 1) for s in combinations(EFFECTS, k)]
    return problem, {(s, 0): refit(force, columns(s)) for s in sets}


def refit(force: Array, lines: Array) -> Any:
    """Least squares on the columns of ``lines`` (n, k)."""
    found = lines @ np.linalg.lstsq(lines, force, rcond=None)[0] if lines.shape[1] else np.zeros(len(force))
    return SimpleNamespace(force=found, log_evidence=-0.5 * float(np.sum((force - found) ** 2)))


def stack(*lines: Array) -> Array:
    return np.column_stack([np.empty((60, 0)), *lines])


def test_on_straight_lines_it_foresees_the_best_triple() -> None:
    """Causes apart from each other: the refit of a triple gains what the screen says, to the damping."""
    rng = np.random.default_rng(3)
    own = dict(zip(EFFECTS, np.linalg.qr(rng.standard_normal((60, 8)))[0].T, strict=True))
    force = 30.0 * own["a"] - 20.0 * own["b"] + 8.0 * own["c"] + rng.standard_normal(60)

    def columns(s: Set) -> Array:
        return stack(*(own[e] for e in sorted(s)))

    problem, fits = world(force, columns)
    order = promising(problem, fits, EFFECTS, 2)
    assert order[0] == TRUE
    exact = sorted(order, key=lambda s: -refit(force, columns(s)).log_evidence)
    assert order[:5] == exact[:5]
    assert set(order) == set(map(frozenset, combinations(EFFECTS, 3)))


def test_a_stand_in_does_not_hide_the_causes_it_stands_in_for() -> None:
    """Effect h alone makes up for all three: every pair of the true set trails behind those with h."""
    rng = np.random.default_rng(5)
    own = dict(zip(EFFECTS, np.linalg.qr(rng.standard_normal((60, 8)))[0].T, strict=True))
    force = 40.0 * (own["a"] + own["b"] + own["c"]) + rng.standard_normal(60)
    own["h"] = own["a"] + own["b"] + own["c"] + 0.4 * own["h"]

    def columns(s: Set) -> Array:
        return stack(*(own[e] for e in sorted(s)))

    problem, fits = world(force, columns)
    pairs = sorted((s for s, _ in fits if len(s) == 2), key=lambda s: -fits[s, 0].log_evidence)
    assert all("h" in s for s in pairs[:6])
    assert promising(problem, fits, EFFECTS, 2)[0] == TRUE


def test_a_line_is_looked_up_beside_the_partner() -> None:
    """Effect c takes another shape beside a than alone: only the pair's own line shows what it brings."""
    rng = np.random.default_rng(7)
    own = dict(zip([*EFFECTS, "alone"], np.linalg.qr(rng.standard_normal((60, 9)))[0].T, strict=True))
    force = 30.0 * own["a"] + 20.0 * own["b"] + 9.0 * own["c"] + rng.standard_normal(60)

    def columns(s: Set) -> Array:
        shape = own | ({} if "a" in s else {"c": own["alone"]})
        return stack(*(shape[e] for e in sorted(s)))

    problem, fits = world(force, columns)
    assert promising(problem, fits, EFFECTS, 2)[0] == TRUE
    # Without the pair's refit nothing is left to see it by.
    del fits[frozenset("ac"), 0]
    assert promising(problem, fits, EFFECTS, 2)[0] != TRUE


def test_sets_without_a_line_or_a_base_are_left_out() -> None:
    problem, fits = world(np.ones(60), lambda s: stack(*(np.ones(60) for _ in s)), largest=1)
    assert promising(problem, fits, EFFECTS, 2) == []
    assert len(promising(problem, fits, EFFECTS, 1)) == 28
    assert promising(problem, fits, ("a",), 1) == [frozenset({"a", e}) for e in "bcdefgh"]


def test_lines_that_are_alike_count_once() -> None:
    """Two parts show the same line: the gain is that of one, which least squares knows."""
    rng = np.random.default_rng(9)
    line, residual = rng.standard_normal((2, 60))
    once = refit(residual, stack(line)).log_evidence + 0.5 * float(residual @ residual)
    assert gain(np.array([line]), residual) == pytest.approx(once, rel=1e-4)
    assert gain(np.array([line, line]), residual) == pytest.approx(once, rel=1e-4)
