"""Which larger sets are worth a refit: how far straight lines along what is known would lower the misfit.

A line is what a cause changes beside one of a set's own parts: what it does alone may be another shape.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mpam_calib.criticism.fit import Fit
from mpam_calib.criticism.problem import Problem
from mpam_calib.criticism.refits import Set

Array = NDArray[np.float64]

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


def gain(lines: Array, residual: Array) -> float:
    """Nats that one linear step along lines (k, n) would gain on a residual (n,), all whitened."""
    power = lines @ lines.T
    damped = power + (LEVEL * np.trace(power) + 1e-9) * np.eye(len(lines))
    along = lines @ residual
    return 0.5 * float(along @ np.linalg.solve(damped, along))
