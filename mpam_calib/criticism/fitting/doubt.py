"""Doubt about an effect's form, in proportion to its size.

No equation of the catalogue is quite what a rig does. A cause that moves the force by 20 N with an equation
good to a few per cent leaves some tenths of a newton of its own, and a small second cause must not be named
for mending them. So each effect of a hypothesis brings columns s(x)·φ_j(x): its share s of the force (N)
times smooth functions of what drives it, with coefficients N(0, δ²/degree²) that are integrated out. How far
equations are off, δ, is not known either: every one of DOUBTS has its say, each as likely as the others.
Kennedy and O'Hagan 2001 (doi:10.1111/1467-9868.00294) call this a model's discrepancy; here each cause has
one, and it vanishes with the cause.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from mpam_calib.model.bend import DRIVERS
from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import Effect, Values
from mpam_calib.model.readings import Readings

Array = NDArray[np.float64]

DOUBTS = (0.0, 0.02, 0.06)
"""Prior sds of a share of an effect's force that its equation gets wrong along one smooth function; 0 takes
the equations at their word."""
DEGREE = 3
PLACE = ("contraction", "pressure")
"""Drivers that every effect may depend on, and jointly."""


def doubts(
    chain: Chain, without: dict[str, Chain], values: Values, eta: Array, readings: Readings, guide: Array
) -> Array:
    """Columns (m, r) in newtons for all effects in question; their coefficients are N(0, δ²).

    ``without`` holds, for each of these effects, the chain that lacks it; ``values`` (1, 1) and ``eta``
    (p,) are where the force is looked at, ``guide`` (m,) an estimate of it (N).
    """
    force = _force(chain, values, eta, readings, guide)
    found = [np.empty((len(readings), 0))]
    for item in chain.effects:
        if item.id in without:
            share = force - _force(without[item.id], values, eta, readings, guide)
            found.append(share[:, None] * _functions(chain, item, readings, guide))
    return np.concatenate(found, axis=1)


def _force(chain: Chain, values: Values, eta: Array, readings: Readings, guide: Array) -> Array:
    terms = chain.terms(values, readings, guide)
    force = terms.fixed + terms.columns @ eta
    return np.asarray(np.broadcast_to(force, (1, len(readings)))[0])


def _functions(chain: Chain, item: Effect, readings: Readings, guide: Array) -> Array:
    """Smooth functions (m, r) of the drivers, scaled to their prior sds."""
    state = chain.start(readings, guide)
    along = {}
    for driver in dict.fromkeys((*PLACE, *item.bends)):
        if driver == "force":  # no more than place and pressure say
            continue
        v = np.broadcast_to(DRIVERS[driver](state, chain.setting), (1, len(readings)))[0]
        along[driver] = legendre.legvander(np.clip(v, -1.0, 1.0), DEGREE)
    columns = [P[:, j] / j for P in along.values() for j in range(1, DEGREE + 1)]
    first, second = (along[driver] for driver in PLACE)
    columns += [
        first[:, i] * second[:, j] / (i + j)
        for i in range(1, DEGREE)
        for j in range(1, DEGREE)
        if i + j <= DEGREE
    ]
    return np.stack(columns, axis=1)
