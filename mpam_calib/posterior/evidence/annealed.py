"""The evidence in many dimensions: a crowd of points is led from Laplace's density to the posterior.

Quadrature does not settle beyond seven or so bent parameters. Here the points begin as draws of Student-t
densities at the modes, q, and pass through densities q^(1 − β) p^β with β from 0 to 1, so slowly that half of
them stay effective; between the steps they move by differences of each other (sequential Monte Carlo: Del
Moral, Doucet and Jasra 2006, doi:10.1111/j.1467-9868.2006.00553.x; moves: ter Braak 2006,
doi:10.1007/s11222-006-8769-1). The way from q is short, from the prior it would be long; other modes that
lie apart are not found. On thin, much bent sheets all crowds lag alike, by nats: ``error`` is therefore not
only how far they differ, but at least half of what they changed of Laplace's figure.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize, special

from mpam_calib.posterior.chains.effective import effective_share
from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.density.mode import Density, Mode, evaluate
from mpam_calib.posterior.evidence.nested import scatter
from mpam_calib.posterior.evidence.quadrature import Evidence

Array = NDArray[np.float64]

CROWDS, POINTS = 4, 200
"""Independent crowds, and points of each."""
EFFECTIVE = 0.5
"""Share of the points that is to stay effective in a step."""
BEST = 2.38
"""Length of a move, over √(2d), that is best for a normal density ..."""
MOVES = (1.0, 0.5, 0.2, 0.8) * 2
"""... and the moves between two steps, in that length."""
JITTER = 1e-5
STEPS, SHORTEST = 30, 1e-12
"""Steps at most, the last of which takes all that is left; and the least of β that one takes."""


def anneal(density: Density, mode: Mode, seed: int = 0) -> Evidence:
    """Evidence of the density about a mode; mean and covariance are those of the points at the end."""
    rng = np.random.RandomState(np.random.SeedSequence([seed, 12]).generate_state(1)[0])
    log_z, u = lead(density, [mode], rng)
    value, error = scatter(log_z[:, None])
    error = max(error, 0.5 * abs(value - mode.log_evidence))
    return Evidence(value, error, u.mean(axis=0), np.cov(u.T))


def lead(density: Density, modes: list[Mode], rng: np.random.RandomState) -> tuple[Array, Array]:
    """Each crowd's log evidence (CROWDS,), and where all points (CROWDS·POINTS, d) end."""
    points = _Points.drawn(density, modes, rng)
    reached, log_z = 0.0, np.zeros(CROWDS)
    for number in range(STEPS):
        if reached == 1.0:
            break
        further = _next(reached, points.log_p - points.log_q) if number < STEPS - 1 else 1.0
        log_weight = ((further - reached) * (points.log_p - points.log_q)).reshape(CROWDS, POINTS)
        log_z += special.logsumexp(log_weight, axis=1) - np.log(POINTS)
        points.keep(_resampled(special.softmax(log_weight, axis=1), rng))
        reached = further
        for length in MOVES:
            points.move(reached, length, rng)
    return log_z, points.u


@dataclass
class _Points:
    """Where all crowds are, u (CROWDS·POINTS, d), and the log densities q and p there."""

    density: Density
    start: StudentMixture
    u: Array
    log_q: Array
    log_p: Array

    @staticmethod
    def drawn(density: Density, modes: list[Mode], rng: np.random.RandomState) -> _Points:
        """Draws of q."""
        start = StudentMixture.build([m.u for m in modes], [m.covariance for m in modes])
        u = start.draw(CROWDS * POINTS, rng)
        return _Points(density, start, u, start.log_density(u), floored(evaluate(density, u)))

    def keep(self, index: NDArray[np.int64]) -> None:
        """These alone (some of them more than once) go on."""
        self.u, self.log_q, self.log_p = self.u[index], self.log_q[index], self.log_p[index]

    def move(self, reached: float, length: float, rng: np.random.RandomState) -> None:
        """One half of each crowd after the other moves by differences of the other half's points."""
        order = np.argsort(rng.random_sample((CROWDS, POINTS)), axis=1) + POINTS * np.arange(CROWDS)[:, None]
        halves = np.split(order, 2, axis=1)
        for own, others in (halves, halves[::-1]):
            at = own.ravel()
            picks = rng.randint(others.shape[1], size=(2, *own.shape))
            one, two = (np.take_along_axis(others, pick, axis=1).ravel() for pick in picks)
            step = length * BEST / np.sqrt(2.0 * self.u.shape[1]) * (self.u[one] - self.u[two])
            tried = self.u[at] + step + JITTER * rng.standard_normal(step.shape)
            log_q, log_p = self.start.log_density(tried), floored(evaluate(self.density, tried))
            gain = reached * (log_p - self.log_p[at]) + (1.0 - reached) * (log_q - self.log_q[at])
            taken = np.log(rng.random_sample(len(at))) < gain
            self.u[at[taken]] = tried[taken]
            self.log_q[at[taken]], self.log_p[at[taken]] = log_q[taken], log_p[taken]


def floored(log_p: Array) -> Array:
    """Impossible points as merely hopeless ones."""
    return np.where(np.isfinite(log_p), log_p, -1e30)


def _next(reached: float, ratio: Array) -> float:
    """The largest β that keeps the points effective."""

    def spare(further: float) -> float:
        return effective_share((further - reached) * ratio) - EFFECTIVE

    if spare(1.0) >= 0.0:
        return 1.0
    return max(float(optimize.brentq(spare, reached, 1.0, xtol=SHORTEST)), reached + SHORTEST)


def _resampled(weight: Array, rng: np.random.RandomState) -> NDArray[np.int64]:
    """Indices of the points that go on, crowd by crowd (systematic; weights (CROWDS, POINTS))."""
    places = (np.arange(POINTS) + rng.random_sample((CROWDS, 1))) / POINTS
    chosen = [np.searchsorted(np.cumsum(w), at) for w, at in zip(weight, places, strict=True)]
    return (np.minimum(chosen, POINTS - 1) + POINTS * np.arange(CROWDS)[:, None]).ravel()
