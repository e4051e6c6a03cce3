"""Readings in steps coarser than their noise: a converter with too few bits, an export with too few digits.

Such an error is no noise: it depends on the force alone and stays the same for as long as the force does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

REPEATED = 3.0
"""Readings to each value that there is, from which on values count as steps."""
NEAR = 0.1
"""Steps by which a difference of values may miss a whole number of them (an export rounds again) ..."""
MOST = 0.95
"""... and the share of the differences that does not miss."""
SHARE = 0.8
"""Root mean square of the steps' error in the noise's from which on there is little else."""


def coarse_step(force: Array, noise: float) -> float:
    """The step (N) of forces (rows,), N, where it makes their ``noise`` (N, sd of a reading); 0 if finer.

    A converter's error is uniform within a step: its root mean square is step/√12 (Widrow and Kollár 2008).
    """
    values = np.unique(force)
    if len(values) < 2 or len(force) < REPEATED * len(values):
        return 0.0
    apart = np.diff(values)
    step = float(np.median(apart[apart < 1.5 * apart.min()]))
    whole = np.abs(apart / step - np.round(apart / step)) < NEAR
    if step / np.sqrt(12.0) < SHARE * noise or np.mean(whole) < MOST:
        return 0.0
    return step
