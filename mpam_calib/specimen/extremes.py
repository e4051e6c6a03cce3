"""Readings at the end of a load cell's range: one extreme force that many of them share."""

from __future__ import annotations

import numpy as np

from mpam_calib.specimen.recording import Bools, Floats, Loops

TIES, TIES_SHARE = 10, 0.005
"""A load cell saturates where so many readings, and such a share of them, are the same extreme value ..."""
OUTSTANDING = 8.0
"""... and so many times as many as at the next values (a coarse converter repeats all of them)."""
NEXT = 5


def saturated(loops: Loops) -> Bools:
    """Readings (rows,) at an end of the load cell's range that many share; the declared floor is none."""
    found = np.zeros(len(loops.force_N), dtype=bool)
    for value in shared_extremes(loops.force_N[~loops.censored], len(found)):
        found |= (loops.force_N == value) & ~loops.censored
    return found


def shared_extremes(force: Floats, readings: int) -> list[float]:
    """The largest and the smallest of forces (any number), each where it is the end of a range; of so many
    ``readings`` in all."""
    values, counts = np.unique(force, return_counts=True)
    if not len(values):
        return []
    ends = ((values[-1], counts[-1], counts[-1 - NEXT : -1]), (values[0], counts[0], counts[1 : 1 + NEXT]))
    return [
        float(value)
        for value, count, near in ends
        if count >= max(TIES, TIES_SHARE * readings) and len(near) and count > OUTSTANDING * near.mean()
    ]
