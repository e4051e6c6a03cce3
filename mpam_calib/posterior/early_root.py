"""Draws that contradict a measured free contraction: a force that is gone short of it.

What stands in the likelihood is that the force is zero there, which a curve meets also where it comes back
from below zero. But a free contraction is the first root, so that such draws have a posterior density of
zero: to reject them is exact.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import CONTRACTION_SD
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.draws import Draws
from mpam_calib.posterior.likelihood.points import FREE

SHORT_SDS, STEP = 5.0, 0.005
"""Sds of a contraction's noise, and steps of the curves' grid, by which a first root is clearly short."""
LEAST = 0.5
"""Share of each ensemble's draws that must be left: with fewer, it is the model that contradicts the data."""
AT_ONCE = 400_000
"""Draws times readings evaluated at once: bounds the memory."""


def without_early_roots(target: Collapsed, draws: Draws, seed: int) -> Draws:
    """The draws, those with an early root replaced by others of their ensemble (where at least half are).

    Nothing changes where no free contraction was measured.
    """
    early = early_roots(target, draws)
    if early is None or not early.any():
        return draws
    own = early.reshape(draws.chains, -1)
    if own.mean(axis=1).max() > 1.0 - LEAST:
        return draws
    rng = np.random.default_rng([seed, 14])
    size = own.shape[1]
    place = np.tile(np.arange(size), (draws.chains, 1))
    for chain, gone in enumerate(own):
        place[chain, gone] = rng.choice(np.flatnonzero(~gone), int(gone.sum()))
    pick = (place + size * np.arange(draws.chains)[:, None]).ravel()
    index = None if draws.index is None else draws.index[place]
    return replace(draws.take(pick), chains=draws.chains, index=index)


def early_roots(target: Collapsed, draws: Draws) -> NDArray[np.bool_] | None:
    """Whether each draw's (N,) friction-free curve is at zero or below clearly short of a free contraction.

    Of each level the least one counts. None where there is none above 0.
    """
    points, model = target.data.points, target.model
    if points is None or model.setting is None or CONTRACTION_SD not in draws.values:
        return None
    free = points.take((points.kind == FREE) & ~points.censored)
    if not len(free):
        return None
    level = free.level(model.setting.levels)
    by_size = np.lexsort((free.readings.displacement, level))
    least = by_size[np.unique(level[by_size], return_index=True)[1]]
    L0 = model.setting.geometry.L0
    pressure, measured = free.readings.pressure[least], free.readings.displacement[least] / L0
    grid = np.arange(int(np.ceil(measured.max() / STEP))) * STEP
    P, g = (each.ravel() for each in np.meshgrid(pressure, grid, indexing="ij"))
    end = np.repeat(measured, len(grid)) - STEP - SHORT_SDS * draws.values[CONTRACTION_SD]
    inside = g < end.max(axis=0)
    readings, g, end = Readings.at_rest(P[inside], L0 * g[inside]), g[inside], end[:, inside]
    early = np.zeros(len(draws), dtype=bool)
    size = max(1, AT_ONCE // max(len(readings), 1))
    for i in range(0, len(draws) if len(readings) else 0, size):
        some = draws.take(np.arange(i, min(i + size, len(draws))))
        force = predict_force(model, some.values, some.eta, readings)
        early[i : i + size] = ((force <= 0.0) & (g < end[i : i + size])).any(axis=1)
    return early
