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
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.free_ends import SHORT_SDS, STEP, Short
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.draws import Draws

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
    short = Short.of(points, model)
    if short is None:
        return None
    sd = draws.values[CONTRACTION_SD]
    short = short.take(short.gap > STEP + SHORT_SDS * sd.min())
    early = np.zeros(len(draws), dtype=bool)
    size = max(1, AT_ONCE // max(len(short.gap), 1))
    for i in range(0, len(draws) if len(short.gap) else 0, size):
        some = draws.take(np.arange(i, min(i + size, len(draws))))
        force = predict_force(model, some.values, some.eta, short.readings)
        early[i : i + size] = short.gone(force, sd[i : i + size])
    return early
