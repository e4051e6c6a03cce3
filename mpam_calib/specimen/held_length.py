"""Pressure that is ramped while the crosshead stands: no motion tells the branch of such readings."""

from __future__ import annotations

import numpy as np

from mpam_calib.errors import InputError
from mpam_calib.specimen.motion import noise_sd, run_ids, run_starts, turn_threshold
from mpam_calib.specimen.recording import Floats, Ints

SPAN_SHARE, NOISE_SDS = 1.0 / 3.0, 10.0
"""Share of the largest pressure, and sds of the gauge's noise, that a ramp at a held length goes over."""
FEWEST, INSIDE = 10, (0.1, 0.9)
"""Rows of such a ramp at least, and the quantiles between which it counts: glitches lie beyond."""
BEYOND = 1.5
"""Times the largest pressure of any motion that ramps reach: levels are filled to what is then recorded."""


def check_held_length(label: str, displacement: Floats, pressure: Floats, rows: Ints) -> None:
    """Refuse ramps of the pressure (kPa, (n,)) at two held lengths (mm) or more, without a branch.

    Levels that are filled and vented while the crosshead stands are none: the motion after them shows the
    pressure that they were filled to. ``rows`` are the editor's numbers of the readings.
    """
    largest = float(np.abs(pressure).max())
    least = max(SPAN_SHARE * largest, NOISE_SDS * noise_sd(pressure))
    near = turn_threshold(displacement)
    ramped = np.zeros(len(pressure), dtype=bool)
    ramps = []
    for shift in (0.0, 0.5):  # what stays within half a cell lies in one cell of either grid
        runs = run_ids(np.floor(displacement / (2.0 * near) + shift).astype(np.int64))
        starts = run_starts(runs)
        ends = np.append(starts[1:], len(runs))
        span = np.maximum.reduceat(pressure, starts) - np.minimum.reduceat(pressure, starts)
        for i in np.flatnonzero((span > least) & (ends - starts >= FEWEST)):
            here = slice(int(starts[i]), int(ends[i]))
            low, high = np.quantile(pressure[here], INSIDE)
            if high - low > least:
                ramped[here] = True
                ramps.append((here, float(high), round(float(np.median(displacement[here])), 3) + 0.0))
    moving = float(pressure[~ramped].max(initial=0.0))
    alone = [(here, at) for here, high, at in ramps if high > BEYOND * moving]
    places = [at for _, at in alone]
    if not alone or max(places) - min(places) <= 2.0 * near:
        return
    first, at = min(alone, key=lambda ramp: ramp[0].start)
    low, high = float(pressure[first].min()), float(pressure[first].max())
    found = f"a pressure that changes at a held length ({low:.4g} to {high:.4g} kPa at {at:.4g} mm)"
    expected = "loops over length, or a column branch (pressurising, depressurising)"
    raise InputError(label, found, expected, int(rows[first.start]), "pressure_kPa")
