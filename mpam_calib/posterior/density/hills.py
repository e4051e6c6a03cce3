"""Further hills of a density beside a mode, which climbs from one start miss.

Along each coordinate through the mode, the others held, the density is looked at on one fine and one wide
line; every top there that is not the mode's own is climbed from, and a hill that is found is looked around
from in turn. The rates of a law can have either sign, and the better one need not be the first that is
found. Hills that no such line crosses stay unseen.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.density.mode import HOPELESS, Density, Mode, climb, curvature, evaluate

Array = NDArray[np.float64]

WIDE = np.linspace(-4.0, 4.0, 81)
"""Places looked at, prior sds ..."""
FINE = np.linspace(-20.0, 20.0, 81)
"""... and, in the sds of each coordinate given the others, around the mode."""
OWN = 2.0
"""Such sds within which a top is the mode's own."""
APART = 4.0
"""Squared distance, for each parameter, from which hills are two."""
MOST = 6
"""Hills at most."""


def hills(density: Density, mode: Mode) -> list[Mode]:
    """The mode, and any others that are no more than HOPELESS nats below the best."""
    found = [mode]
    for seen in found:  # grows: a hill may show the next one
        for start in _tops(density, seen):
            u, top = climb(density, start)
            if not np.isfinite(top) or top < max(m.log_posterior for m in found) - HOPELESS:
                continue
            if len(found) < MOST and all(_distance(m, u) > APART * len(u) for m in found):
                found.append(Mode(u, top, curvature(density, u, top)))
    best = max(m.log_posterior for m in found)
    return [m for m in found if m.log_posterior >= best - HOPELESS]


def _tops(density: Density, mode: Mode) -> Array:
    """Where the density has a top of its own along a coordinate, the others at the mode: (n, d)."""
    sd = 1.0 / np.sqrt(np.diagonal(np.linalg.inv(mode.covariance)))
    lines = [np.unique(np.concatenate([WIDE, u + s * FINE])) for u, s in zip(mode.u, sd, strict=True)]
    places = np.repeat(mode.u[None], sum(map(len, lines)), axis=0)
    which = np.repeat(np.arange(len(lines)), [len(line) for line in lines])
    places[np.arange(len(places)), which] = np.concatenate(lines)
    log_p = evaluate(density, places)
    inner = (which[1:-1] == which[:-2]) & (which[1:-1] == which[2:])
    top = inner & (log_p[1:-1] > log_p[:-2]) & (log_p[1:-1] >= log_p[2:])
    away = np.abs(np.concatenate(lines) - mode.u[which]) > OWN * sd[which]
    return np.asarray(places[1:-1][top & away[1:-1]])


def _distance(mode: Mode, u: Array) -> float:
    return float((u - mode.u) @ np.linalg.solve(mode.covariance, u - mode.u))
