"""The thesis's test protocol (its section 4.6) as readings without forces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.specimen.recording import LOADING, UNLOADING, Loops
from mpam_calib.units import KPA, MINUTE, MM

Array = NDArray[np.float64]

LEVELS = np.array([50.0, 100.0, 150.0, 200.0, 250.0]) * KPA
SPEED = 50.0 * MM / MINUTE
RATE = 100.0
"""Readings per second."""


def thesis_protocol(free_contractions: Array, L0: float) -> Loops:
    """Loops at five levels: from free contraction to L0 and back at 50 mm/min, 100 readings a second.

    ``free_contractions`` (5,), of a muscle of length ``L0`` (m); forces are zero, still to be made.
    """
    parts: list[Array] = []
    for level, contraction in enumerate(free_contractions):
        rows = max(round(contraction * L0 / SPEED * RATE), 8)
        path = np.linspace(contraction * L0, 0.0, rows)
        for stroke, (branch, x) in enumerate(((LOADING, path), (UNLOADING, path[::-1]))):
            index = np.full(rows, 2.0 * level + stroke)
            constant = [np.full(rows, value) for value in (level, branch)]
            parts.append(np.stack([x, *constant, index], axis=1))
    table = np.concatenate(parts)
    x, level_of, branch_of, stroke_of = table.T
    n = len(x)
    integer = [column.astype(np.int64) for column in (level_of, branch_of, stroke_of)]
    return Loops(
        time_s=np.arange(n) / RATE,
        pressure_Pa=LEVELS[integer[0]],
        displacement_m=x,
        force_N=np.zeros(n),
        level=integer[0],
        cycle=np.ones(n, dtype=np.int64),
        branch=integer[1],
        stroke=integer[2],
        clock=np.zeros(n, dtype=np.int64),
        censored=np.zeros(n, dtype=bool),
    )
