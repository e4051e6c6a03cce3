"""What could hide beside what is found: how large each effect may be, by itself, without being seen.

"Adequate" says that no cause was shown, not that there is none, and causes that are named may not be all. The
posterior of one effect's size beside the declared simulation and the causes named, with Laplace's integral
over all else at every value of the size, says how much of it these data leave room for.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray
from scipy import integrate, interpolate, linalg

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.climb import Climb, Place, furthest_of
from mpam_calib.criticism.fitting.fit import Fit, chain_for, doubt_about
from mpam_calib.criticism.fitting.refits import named_forms
from mpam_calib.criticism.tasks.spread import Alone, Spread, held_problem
from mpam_calib.model.effect import effect

Array = NDArray[np.float64]

BAND = (0.05, 0.95)
STEPS, WIDEST = 4.0, 0.1
"""Points per posterior sd, and their largest distance (prior sds): near a bound a density is no parabola."""
DEPTH = 9.0
"""Nats below the highest point at which the density counts for nothing."""
FEWEST, MOST_POINTS, FINE = 3, 400, 2000
"""Points at which the density is looked at, in all and on either side, and that are interpolated."""
EXCLUDED = 5.0
"""Nats behind the best kind of an effect (whose clock, which force) from which on a kind is left out."""

NOTHING: frozenset[str] = frozenset()
Band = tuple[float, float]


def hidden_sizes(
    problem: Problem, effects: Iterable[str], named: Fit, spread: Spread | None = None
) -> dict[str, Band]:
    """The 90 % band (SI) of the size of each effect that has just one parameter.

    Beside it are noise, the causes that are ``named`` and the doubt about their forms, but no remainder: what
    that may hold could hide anything. An effect of several kinds has the band that holds those of all.
    """
    kinds = [
        kind
        for e in effects
        if e not in named_forms(named)
        for kind in (e, *(f"{e}:{name}" for name in effect(e).kinds))
        if len(effect(kind).parameters(problem.setting)) == 1
    ]
    doubt = doubt_about(problem, problem.declared, named)
    tasks = [(named, doubt, kind) for kind in kinds]
    found: dict[str, list[tuple[float, Band]]] = {}
    for kind, band in zip(kinds, (spread or Alone(problem))(_band, tasks), strict=True):
        if band is not None:
            found.setdefault(kind.partition(":")[0], []).append(band)
    bands = {}
    for e, of_kinds in found.items():
        best = max(evidence for evidence, _ in of_kinds)
        lows, highs = zip(*(band for evidence, band in of_kinds if evidence > best - EXCLUDED), strict=True)
        bands[e] = (min(lows), max(highs))
    return bands


def _beside(problem: Problem, named: Fit, doubt: Array, further: frozenset[str] = NOTHING) -> Climb:
    """A climb of the causes named and further ones, beside a doubt about the former (n, r), N."""
    chain = chain_for(problem.declared, named.effects | further)
    return Climb(problem, chain, 0, doubt)


def _band(task: tuple[Fit, Array, str]) -> tuple[float, Band] | None:
    """The log evidence (up to a constant) and the band; None where no muscle, or no reading, has it."""
    named, doubt, form = task
    climb = _beside(held_problem(), named, doubt, frozenset([form]))
    (own,) = effect(form).parameters(climb.problem.setting)
    start = named.ended
    u = np.array([start.get(name, 0.0) for name in climb.names], dtype=np.float64)
    try:
        with np.errstate(over="ignore", invalid="ignore"):  # of shapes that no muscle has
            mode = climb.climb(u, climb.guide(), np.zeros(climb.chain.linear_size))
            if not np.any(mode.moved[:, climb.names.index(own.name)]):
                return None
            points, found = _walk(climb, mode, climb.names.index(own.name))
    except (np.linalg.LinAlgError, ValueError):  # scipy's word for slopes that are not finite
        return None
    if len(points) < FEWEST:
        return None
    u = np.linspace(points[0], points[-1], FINE)
    log_density = interpolate.PchipInterpolator(points, found)(u)
    top = float(log_density.max())
    density = np.exp(log_density - top)
    mass = integrate.cumulative_trapezoid(density, u, initial=0)
    low, high = np.interp(BAND, mass / mass[-1], own.prior.from_normal(u))
    return top + float(np.log(mass[-1])), (float(low), float(high))


def _walk(climb: Climb, mode: Place, i: int) -> tuple[Array, Array]:
    """Coordinates of one size, on both sides of the mode, and the log density there (up to a constant)."""
    J = climb.slopes(mode)
    covariance = linalg.inv(J.T @ J + np.eye(J.shape[1]))
    step = min(float(np.sqrt(covariance[i, i])) / STEPS, WIDEST)
    furthest = float(furthest_of(climb.chain.parameters)[i])
    found = {float(mode.u[i]): (top := _log_density(climb, mode, i))}
    p = climb.chain.linear_size
    for direction in (-step, step):
        place = mode
        for _point in range(MOST_POINTS):
            u = place.u.copy()
            u[i] += direction
            if abs(u[i]) > furthest:
                break
            place = climb.look_with_its_signs(u, place.guide, place.eta[:p])
            if not np.isfinite(place.objective):  # no muscle
                break
            place = _eased(climb, place, i)
            found[float(u[i])] = value = _log_density(climb, place, i)
            top = max(top, value)
            if value < top - DEPTH:
                break
    u = np.array(sorted(found))
    return u, np.array([found[x] for x in u])


def _others(climb: Climb, place: Place, i: int) -> tuple[Array, Array, Array]:
    """Hessian and gradient of all coordinates but the i-th, and which of them are sizes."""
    others = np.delete(np.arange(len(place.u) + place.columns.shape[1]), i)
    J = climb.slopes(place)[:, others]
    gradient = J.T @ place.residual - np.concatenate([place.u, place.eta])[others]
    return J.T @ J + np.eye(len(others)), gradient, others


def _eased(climb: Climb, place: Place, i: int) -> Place:
    """The place after one step of all other coordinates towards their best."""
    hessian, gradient, others = _others(climb, place, i)
    sizes = others < len(place.u)
    if not sizes.any():
        return place
    u = place.u.copy()
    u[others[sizes]] += linalg.solve(hessian, gradient, assume_a="pos")[sizes]
    better = climb.look_with_its_signs(u, place.guide, place.eta[: climb.chain.linear_size])
    return better if better.objective > place.objective else place


def _log_density(climb: Climb, place: Place, i: int) -> float:
    """Laplace's integral over all other coordinates."""
    hessian, gradient, _ = _others(climb, place, i)
    if not len(gradient):
        return place.objective
    factor = linalg.cho_factor(hessian, lower=True)
    log_det = 2.0 * float(np.sum(np.log(np.diagonal(factor[0]))))
    return place.objective + 0.5 * float(gradient @ linalg.cho_solve(factor, gradient)) - 0.5 * log_det
