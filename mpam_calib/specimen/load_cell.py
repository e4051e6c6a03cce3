"""What the readings of loops say about the load cell: that it reached the end of its range."""

from __future__ import annotations

import numpy as np

from mpam_calib.specimen.extremes import shared_extremes
from mpam_calib.specimen.recording import Bools, Loops

AT_TURNS = 0.02
"""Share of a stroke's way, at either end, where a crosshead that dwells repeats a force by itself."""


def odd_readings(loops: Loops) -> list[str]:
    """Remarks on forces that hardly are the muscle's."""
    return _at_a_limit(loops)


def _at_a_limit(loops: Loops) -> list[str]:
    """An extreme force that many readings share while the muscle moves."""
    asked = loops.force_N[_under_way(loops) & ~loops.censored]
    remarks = []
    for value in shared_extremes(asked, len(loops.force_N)):
        count = int(np.count_nonzero((loops.force_N == value) & ~loops.censored))
        largest = value == asked.max()
        question = (
            "did the load cell or its amplifier reach its limit?"
            if largest
            else f"is the muscle slack there? force_floor_N = {value:g} in [sensors] would say so"
        )
        remarks.append(
            f"loops: {count} of {len(loops.force_N)} readings are exactly {value:.6g} N, "
            f"the {'largest' if largest else 'smallest'}: {question}"
        )
    return remarks


def _under_way(loops: Loops) -> Bools:
    """Whether the crosshead is away from the ends of its stroke (rows,)."""
    first, rows = loops.strokes
    low = np.repeat(np.minimum.reduceat(loops.displacement_m, first), rows)
    high = np.repeat(np.maximum.reduceat(loops.displacement_m, first), rows)
    margin = AT_TURNS * (high - low)
    return np.asarray((loops.displacement_m > low + margin) & (loops.displacement_m < high - margin))
