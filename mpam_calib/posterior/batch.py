"""How many parameter vectors are evaluated at once: enough for NumPy, few enough for the memory."""

from __future__ import annotations

from mpam_calib.posterior.collapsed import Collapsed

CELLS = 400_000
"""Readings × columns × vectors at once: arrays of this size pass through the processor's caches."""
FEWEST, MOST = 4, 128


def batch_size(target: Collapsed) -> int:
    """Vectors at once for a target."""
    data = target.data
    parts = (data.bins, data.points, None if data.tensile is None else data.tensile.strain)
    readings = sum(len(part) for part in parts if part is not None)
    cells = readings * (1 + sum(target.model.linear_sizes))
    return max(FEWEST, min(MOST, CELLS // max(cells, 1)))
