"""What could hide beside what is found: how large each effect may be, by itself, without being seen.

"Adequate" says that no cause was shown, not that there is none, and causes that are named may not be all. The
posterior of one effect's size beside the declared simulation and the causes named, with Laplace's integral
over all else at every value of the size, says how much of it these data leave room for. Where they leave
room for none, however small, that is not a band about the least bad size but one of nothing.
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
from mpam_calib.model.priors import Parameter

Array = NDArray[np.float64]

BAND = (0.05, 0.95)
STEPS, WIDEST = 4.0, 0.1
"""Points per posterior sd, and their largest distance (prior sds): near a bound a density is no parabola."""
DEPTH = 9.0
"""Nats below the highest point at which the density counts for nothing."""
NEAR_NOTHING = (-3.5, -7.0)
"""Coordinates of a size of one sign from which on it is sought, where no mode about the usual will do."""
FEWEST, MOST_POINTS, FINE = 3, 400, 2000
"""Points at which the density is looked at, in all and on either side, and that are interpolated."""
EXCLUDED = 5.0
"""Nats behind the best kind of an effect (whose clock, which force) from which on a kind is left out: each at
its best size, for one whose sizes are known the more narrowly may be there none the less; and nats behind
the fit without it from which on no size of an effect is left room for."""

NOTHING: frozenset[str] = frozenset()
Band = tuple[float, float]
NO_ROOM: Band = (0.0, 0.0)
"""The band of an effect of which every size was worse than none."""


def hidden_sizes(
    problem: Problem, effects: Iterable[str], named: Fit, spread: Spread | None = None
) -> dict[str, Band]:
    """The 90 % band (SI) of the size of each effect that has just one parameter.

    Beside it are noise, the causes that are ``named`` and the doubt about their forms, but no remainder: what
    that may hold could hide anything. An effect of several kinds has the band that holds those of all; one
    that the data have no room for, whatever its size, has NO_ROOM.
    """
    kinds = [
        kind
        for e in effects
        if e not in named_forms(named)
        for kind in (e, *(f"{e}:{name}" for name in effect(e).kinds))
        if len(effect(kind).parameters(problem.setting)) == 1
    ]
    doubt = doubt_about(problem, problem.declared, named)
    without = _without(problem, named, doubt)
    tasks = [(named, doubt, without, kind) for kind in kinds]
    found: dict[str, list[tuple[float, Band]]] = {}
    for kind, band in zip(kinds, (spread or Alone(problem))(_band, tasks), strict=True):
        if band is not None:
            found.setdefault(kind.partition(":")[0], []).append(band)
    bands = {}
    for e, of_kinds in found.items():
        best = max(top for top, _ in of_kinds)
        lows, highs = zip(*(band for top, band in of_kinds if top >= best - EXCLUDED), strict=True)
        bands[e] = (min(lows), max(highs))
    return bands


def _beside(problem: Problem, named: Fit, doubt: Array, further: frozenset[str] = NOTHING) -> Climb:
    """A climb of the causes named and further ones, beside a doubt about the former (n, r), N."""
    chain = chain_for(problem.declared, named.effects | further)
    return Climb(problem, chain, 0, doubt)


def _without(problem: Problem, named: Fit, doubt: Array) -> float:
    """The log likelihood (up to a constant) without a further effect, all else integrated out.

    -inf, which nothing is worse than, where no climb ends.
    """
    climb = _beside(problem, named, doubt)
    u = np.array([named.ended.get(name, 0.0) for name in climb.names], dtype=np.float64)
    try:
        place = climb.climb(u, climb.guide(), np.zeros(climb.chain.linear_size))
        return _log_density(climb, place, None)
    except np.linalg.LinAlgError:
        return -np.inf


def _band(task: tuple[Fit, Array, float, str]) -> tuple[float, Band] | None:
    """The highest log density and the band; None where no muscle, or no reading, has it."""
    named, doubt, without, form = task
    climb = _beside(held_problem(), named, doubt, frozenset([form]))
    (own,) = effect(form).parameters(climb.problem.setting)
    i = climb.names.index(own.name)
    # A climb may end at a size that is only better than its neighbours: next to nothing another may be as
    # good as none. Of either sign the first start is nothing itself.
    one_sign = own.prior.from_normal(np.array([-1.0]))[0] >= 0.0
    walks = []
    for start in (0.0, *(NEAR_NOTHING if one_sign else ())):
        try:
            with np.errstate(over="ignore", invalid="ignore"):  # of shapes that no muscle has
                walked = _walk_from(climb, named, i, start)
        except (np.linalg.LinAlgError, ValueError):  # scipy's word for slopes that are not finite
            continue
        if walked is None:
            continue
        walks.append(walked)
        points, log_density = walked
        # Without its own prior the density of a size is a likelihood, which that of nothing compares with.
        if float(np.max(log_density + 0.5 * points**2)) > without - EXCLUDED:
            return _told(points, log_density, own) if len(points) >= FEWEST else None
    return (-np.inf, NO_ROOM) if walks else None


def _walk_from(climb: Climb, named: Fit, i: int, start: float) -> tuple[Array, Array] | None:
    """:func:`_walk` about the mode reached from a coordinate of the size; None where no reading moves."""
    u = np.array([named.ended.get(name, 0.0) for name in climb.names], dtype=np.float64)
    u[i] = start
    mode = climb.climb(u, climb.guide(), np.zeros(climb.chain.linear_size))
    return _walk(climb, mode, i) if np.any(mode.moved[:, i]) else None


def _told(points: Array, found: Array, own: Parameter) -> tuple[float, Band]:
    """The top and the band of a log density ``found`` at coordinates of a size."""
    u = np.linspace(points[0], points[-1], FINE)
    log_density = interpolate.PchipInterpolator(points, found)(u)
    top = float(log_density.max())
    density = np.exp(log_density - top)
    mass = integrate.cumulative_trapezoid(density, u, initial=0)
    low, high = np.interp(BAND, mass / mass[-1], own.prior.from_normal(u))
    return top, (float(low), float(high))


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


def _others(climb: Climb, place: Place, i: int | None) -> tuple[Array, Array, Array]:
    """Hessian and gradient of all coordinates but the i-th, and which of them are sizes."""
    others = np.delete(np.arange(len(place.u) + place.columns.shape[1]), [] if i is None else i)
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


def _log_density(climb: Climb, place: Place, i: int | None) -> float:
    """Laplace's integral over all other coordinates, or over all there are."""
    hessian, gradient, _ = _others(climb, place, i)
    if not len(gradient):
        return place.objective
    factor = linalg.cho_factor(hessian, lower=True)
    log_det = 2.0 * float(np.sum(np.log(np.diagonal(factor[0]))))
    return place.objective + 0.5 * float(gradient @ linalg.cho_solve(factor, gradient)) - 0.5 * log_det
