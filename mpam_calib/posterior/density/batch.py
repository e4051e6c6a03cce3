"""How many parameter vectors are evaluated at once: enough for NumPy, few enough for the memory."""

from __future__ import annotations

from mpam_calib.posterior.density.collapsed import Collapsed

CELLS = 400_000
"""Readings × columns × vectors at once: arrays of this size pass through the processor's caches."""
FEWEST, MOST = 4, 128


def batch_size(target: Collapsed) -> int:
    """Vectors at once for a target."""
    return max(FEWEST, min(MOST, CELLS // max(target.cells, 1)))
