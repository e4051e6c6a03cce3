"""Which larger sets are worth a refit: how far straight lines along what is known would lower the misfit.

A line is what a cause changes beside one of a set's own parts: what it does alone may be another shape.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.refits import Set

Array = NDArray[np.float64]

LIKELIEST = 5
"""Partners of a set that lines promise most of."""
LEVEL = 1e-6
"""Share of its power by which a line is damped: lines of one cause are often alike."""


def promising(
    problem: Problem, fits: Mapping[tuple[Set, int], Fit], tested: tuple[str, ...], count: int
) -> list[Set]:
    """Sets of one cause more than ``count``, from all that was refitted without a remainder; best first."""
    force = problem.white(problem.force, 0)
    known = {s: problem.white(f.force, 0) for (s, size), f in fits.items() if size == 0 and len(s) <= count}
    reached: dict[Set, float] = {}
    for base in sorted((s for s in known if len(s) == count), key=sorted):
        residual = force - known[base]
        parts = dict.fromkeys([frozenset[str](), *(base - {e} for e in sorted(base))])
        for new in tested:
            lines = [known[p | {new}] - known[p] for p in parts if {p, p | {new}} <= known.keys()]
            if new in base or not lines:
                continue
            found = fits[base, 0].log_evidence + gain(np.array(lines), residual)
            reached[base | {new}] = max(found, reached.get(base | {new}, -np.inf))
    return sorted(reached, key=lambda s: (-reached[s], sorted(s)))


def partners(
    problem: Problem,
    fits: Mapping[tuple[Set, int], Fit],
    tested: tuple[str, ...],
    effects: Set,
    size: int,
    singles: list[str],
) -> list[str]:
    """Effects worth adding to a set: those of which lines promise most, and ``singles``.

    By the residual that it leaves beside a remainder of this ``size`` and, where that is known, beside none.
    """
    new = [p for p in tested if p not in effects]

    def promised(at: int) -> list[str]:
        gains = {p: _alone(problem, fits, effects, p, at) for p in new}
        return sorted(gains, key=lambda p: -gains[p])[:LIKELIEST]

    bare = promised(0) if (effects, 0) in fits else promised(size)
    return list(dict.fromkeys([*promised(size), *bare, *(s for s in singles if s in new)]))


def _alone(
    problem: Problem, fits: Mapping[tuple[Set, int], Fit], effects: Set, partner: str, size: int
) -> float:
    """Nats that one linear step along what a partner does alone would gain on a set (moduli free)."""
    single, nothing = fits.get((frozenset([partner]), size)), fits.get((frozenset(), size))
    if single is None or nothing is None:
        return -np.inf
    signature = problem.white(single.force - nothing.force, size)
    return gain(signature[None], problem.white(problem.force - fits[effects, size].force, size))


def gain(lines: Array, residual: Array) -> float:
    """Nats that one linear step along lines (k, n) would gain on a residual (n,), all whitened."""
    power = lines @ lines.T
    damped = power + (LEVEL * np.trace(power) + 1e-9) * np.eye(len(lines))
    along = lines @ residual
    return 0.5 * float(along @ np.linalg.solve(damped, along))
