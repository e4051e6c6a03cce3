"""How moduli that are free at each level may go on beyond all levels, of which no law of theirs speaks.

They change with the pressure as much as they did between the two last levels, or by as much the other way;
those of a single level, which cannot tell, by a share of themselves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.density.target import predict_force

Array = NDArray[np.float64]

ALONE = 0.5
"""Of the moduli at a single level, the sd of their change from there to twice the pressure."""


def moduli_beyond(model: Model, values: dict[str, Array], eta: Array, readings: Readings) -> Array | None:
    """Force (B, n), N, of one sd of the change: 0 from the lowest to the highest level, None under a law."""
    setting, chain = model.setting, model.chain
    if setting is None or chain is None or setting.simulation.law != "free":
        return None
    levels, P = setting.levels, readings.pressure
    lowest, highest = levels[0], levels[-1]
    found = np.zeros((len(eta), len(P)))
    outside = np.flatnonzero((highest < P) | ((lowest > P) & (P >= 0.0)))
    if not len(outside) or highest <= 0.0:
        return found
    P, rows = P[outside], readings.take(outside)
    if len(levels) == 1:
        without = predict_force(model, values, np.zeros_like(eta), rows)
        bladder = predict_force(model, values, eta, rows) - without
        found[:, outside] = ALONE * np.abs(P / lowest - 1.0) * bladder
        return found
    edge = np.where(highest < P, len(levels) - 1, 0)
    inner = np.where(highest < P, len(levels) - 2, 1)
    steps = np.abs((P - levels[edge]) / (levels[edge] - levels[inner]))
    # Readings of a level have its moduli whatever their pressure.
    last, before = (
        predict_force(model, values, eta, replace(rows, level=level.astype(np.int64)))
        for level in (edge, inner)
    )
    found[:, outside] = steps * (last - before)
    return found
