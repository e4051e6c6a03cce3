"""The evidence of a bent posterior by points of a mixture that is refitted to it, round by round.

Where the nested rule (:mod:`mpam_calib.posterior.nested`) does not settle, more points of it hardly help:
what it draws from misses a part. Here a crowd that was led to the posterior
(:mod:`mpam_calib.posterior.annealed`) shows where it lies. Student-t densities are fitted to the crowd,
points drawn from them by a randomised quasi-Monte Carlo rule, and the densities fitted again to all weighted
points; all rounds count together (Cornuet and others 2012, doi:10.1111/j.1467-9469.2011.00756.x). For few
parameters: in many the weights grow uneven.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import special
from scipy.stats import qmc

from mpam_calib.posterior.annealed import lead
from mpam_calib.posterior.evidence import Evidence
from mpam_calib.posterior.mode import Density, Mode, evaluate
from mpam_calib.posterior.nested import BEYOND, place, scatter
from mpam_calib.posterior.proposal import StudentMixture, fit_normals

Array = NDArray[np.float64]

SHIFTS, POINTS = 8, 256
"""Randomisations of a round, and points of each."""
LEAST, ROUNDS = 4, 8
"""Rounds at least, and at most."""
ENOUGH = 0.003
"""Error (nats) at which the rounds end."""
COMPONENTS, EACH = 10, 20
"""Densities at most, and effective points that each of them must have for every parameter."""
INFLATION = 1.15
"""Width of the densities in that of the points they were fitted to."""


def integrate_refitted(density: Density, mode: Mode, seed: int = 0) -> Evidence:
    """Evidence of the density about a mode, and the posterior's mean and covariance."""
    rng = np.random.default_rng([seed, 13])
    _, crowd = lead(density, mode, np.random.RandomState(rng.integers(2**32 - 1)))
    drawn = [_fitted(crowd, np.full(len(crowd), 1.0 / len(crowd)))]
    d = crowd.shape[1]
    u, log_p = np.empty((0, d)), np.empty(0)
    while True:
        shares = np.concatenate([qmc.Sobol(d + 2, rng=rng).random(POINTS) for _ in range(SHIFTS)])
        new = place(drawn[-1], np.clip(shares, BEYOND, 1.0 - BEYOND))
        u, log_p = np.concatenate([u, new]), np.concatenate([log_p, evaluate(density, new)])
        log_q = np.logaddexp.reduce([q.log_density(u) for q in drawn]) - np.log(len(drawn))
        log_w = log_p - log_q
        value, error = scatter(np.concatenate(list(log_w.reshape(-1, SHIFTS, POINTS)), axis=1))
        weight = special.softmax(log_w)
        if len(drawn) == ROUNDS or (len(drawn) >= LEAST and error <= ENOUGH):
            mean = weight @ u
            return Evidence(value, error, mean, (u - mean).T @ ((u - mean) * weight[:, None]))
        drawn.append(_fitted(u, weight))


def _fitted(u: Array, weight: Array) -> StudentMixture:
    effective = 1.0 / float(np.sum(weight**2))
    count = int(np.clip(effective / (EACH * u.shape[1]), 1, COMPONENTS))
    means, covariances, shares = fit_normals(u, weight, count)
    return StudentMixture.build(means, [INFLATION**2 * c for c in covariances], shares)
