"""The evidence of a bent posterior by points of a mixture that is refitted to it, round by round.

Where the nested rule (:mod:`mpam_calib.posterior.evidence.nested`) does not settle, more points of it
hardly help: what it draws from misses a part. Here a crowd that was led to the posterior
(:mod:`mpam_calib.posterior.evidence.annealed`) shows where it lies. Student-t densities are fitted to the
crowd, points drawn from them by a randomised quasi-Monte Carlo rule, and the densities fitted again to all
points, which all weigh together for that (Cornuet and others 2012, doi:10.1111/j.1467-9469.2011.00756.x).
For the evidence itself every point counts by the density it was drawn from, fitted before it was drawn:
densities that were fitted to the points they weigh say too little, by up to 0.05 nat, and an error that is
far too small. Some densities are fitted to a power of the posterior: they reach into arms which few points
found yet. For few parameters: in many the weights grow uneven.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.stats import qmc

from mpam_calib.posterior.chains.proposal import StudentMixture, fit_normals
from mpam_calib.posterior.density.hills import hills
from mpam_calib.posterior.density.mode import Density, Mode, evaluate
from mpam_calib.posterior.evidence.annealed import floored, lead
from mpam_calib.posterior.evidence.nested import BEYOND, place, scatter
from mpam_calib.posterior.evidence.quadrature import Evidence

Array = NDArray[np.float64]

SHIFTS, POINTS = 8, 512
"""Randomisations of a round, and points of each."""
LEAST, ROUNDS = 5, 12
"""Rounds at least, and at most; the later half counts."""
ENOUGH = 0.004
"""Error (nats) at which the rounds end."""
COMPONENTS, EACH = 20, 20
"""Densities at most, and effective points that each of them must have for every parameter."""
INFLATION = 1.15
"""Width of the densities in that of the points they were fitted to."""
TEMPER, SHARE = 0.4, 0.2
"""Power of the posterior that further densities are fitted to, and their share of the points."""
PICKED = 4000
"""Points, drawn by their weights, that densities are fitted to."""


def integrate_refitted(density: Density, mode: Mode, seed: int = 0) -> Evidence:
    """Evidence of the density about a mode, and the posterior's mean and covariance."""
    rng = np.random.default_rng([seed, 13])
    d = len(mode.u)
    _, u = lead(density, hills(density, mode), np.random.RandomState(rng.integers(2**32 - 1)))
    log_p, log_w = floored(evaluate(density, u)), np.zeros(len(u))
    drawn = [_fitted(u, log_w, log_p, rng)]
    u, log_p, log_q = np.empty((0, d)), np.empty(0), np.empty(0)
    rounds: list[Array] = []
    while True:
        shares = np.concatenate([qmc.Sobol(d + 2, rng=rng).random(POINTS) for _ in range(SHIFTS)])
        new = place(drawn[-1], np.clip(shares, BEYOND, 1.0 - BEYOND))
        new_p, new_q = floored(evaluate(density, new)), np.stack([q.log_density(new) for q in drawn])
        rounds.append((new_p - new_q[-1]).reshape(SHIFTS, POINTS))
        log_q = np.logaddexp(log_q, drawn[-1].log_density(u))
        u, log_p = np.concatenate([u, new]), np.concatenate([log_p, new_p])
        log_q = np.concatenate([log_q, np.logaddexp.reduce(new_q)])
        log_w = log_p - log_q
        value, error = scatter(np.concatenate(rounds[len(rounds) // 2 :]))
        if len(rounds) == ROUNDS or (len(rounds) >= LEAST and error <= ENOUGH):
            return Evidence.of_points(value, error, u, special.softmax(log_w))
        drawn.append(_fitted(u, log_w, log_p, rng))


def _fitted(u: Array, log_w: Array, log_p: Array, rng: np.random.Generator) -> StudentMixture:
    """Densities fitted to points (n, d) by their weights, and to the same weighed for a power of log_p."""
    means, covariances, shares = _normals(u, log_w, rng)
    further, wider, others = _normals(u, log_w - (1.0 - TEMPER) * log_p, rng)
    every = np.concatenate([(1.0 - SHARE) * shares, SHARE * others])
    return StudentMixture.build(means + further, [INFLATION**2 * c for c in covariances + wider], every)


def _normals(u: Array, log_w: Array, rng: np.random.Generator) -> tuple[list[Array], list[Array], Array]:
    weight = special.softmax(log_w)
    effective = 1.0 / float(np.sum(weight**2))
    count = int(np.clip(effective / (EACH * u.shape[1]), 1, COMPONENTS))
    places = (np.arange(PICKED) + rng.random()) / PICKED
    chosen = np.minimum(np.searchsorted(np.cumsum(weight), places), len(weight) - 1)
    picked, times = np.unique(chosen, return_counts=True)
    return fit_normals(u[picked], times / PICKED, count)
