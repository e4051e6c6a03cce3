"""A space of models ranked by evidence: Laplace's for all, its next term or quadrature near the top.

The evidence of a model is summed over the remainder's sizes. Of models that differ in their law alone those
without rates are fitted first: the moduli free at each level tell where the others' rates may be
(:mod:`mpam_calib.criticism.selection.rates`).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log, pi, sqrt

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit, chain_for, fit
from mpam_calib.criticism.fitting.noise_scale import settle_noise
from mpam_calib.criticism.selection.evidence import SETTLES, log_evidence_beyond_laplace
from mpam_calib.criticism.selection.rates import Rates, find_rates
from mpam_calib.criticism.tasks.spread import Spread, held_problem, spread_over
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.moduli import rate_names
from mpam_calib.specimen.declaration import Simulation

NEAR, LEADING, CLOSE, CHEAP = 50.0, 20.0, 8.0, 15.0
"""Nats below the best within which Laplace's next term or quadrature follows; within which they do for
SETTLES parameters, and the density's own mode and curvature for more; within which models that take long
(more parameters, or rates of each modulus's own) are integrated or annealed; and within which they are
where that is cheap, since most of many parameters are rates."""
PROMISING = 60.0
"""Nats below the best model so far within which a law's rates are searched for all their modes."""
AGAIN = 4
"""Times that rates of each modulus's own are searched again where the model is near the best."""
SMOOTHED = 100.0
"""Nats by which free moduli may like another remainder better, where rates are searched for all modes."""
SILENT = 300.0
"""Nats below a larger remainder at which still smaller ones are not tried."""
CHANCE = 3.0
"""Standard deviations of chi-squared beyond which a better fit is no chance."""
FREE, SHARED, EACH = "free", "exponential", "exponential_each"
Array = NDArray[np.float64]
Start = dict[str, float]


@dataclass(frozen=True)
class Ranked:
    """A model with its fits (one for each size of the remainder) and its log evidence (nats).

    ``error`` is the evidence's standard error, where it is more than Laplace's.
    """

    simulation: Simulation
    fits: list[Fit]
    log_evidence: float
    error: float = float("nan")

    ceiling: float = float("inf")
    """Log likelihood (nats) that the fits reach."""

    @property
    def best(self) -> Fit:
        """The fit at the most probable size of the remainder."""
        return max(self.fits, key=lambda f: f.log_share)


def rank(problem: Problem, space: Sequence[Simulation], *, workers: int = 2) -> list[Ranked]:
    """The models of a space, most evidence first; those that cannot be fitted are left out.

    Those within NEAR nats of the best have their evidence by Laplace's expansion to its next term or, where
    that is large, by quadrature; the others by Laplace's approximation. The noise is settled first
    (:mod:`mpam_calib.criticism.fitting.noise_scale`). One worker means this process.
    """
    with spread_over(settle_noise(problem, space), workers) as spread:
        return rank_spread(spread, space)


def rank_spread(
    spread: Spread,
    space: Sequence[Simulation],
    *,
    tell: Callable[[str, float], None] = lambda stage, share: None,
    always: Callable[[Simulation], bool] = lambda simulation: False,
    seed: int = 0,
) -> list[Ranked]:
    """:func:`rank` by workers that hold the problem; ``always`` names models that are integrated anyhow.

    ``seed`` is that of the searches for rates and of the integrals' points.
    """
    groups = _by_law(space)
    plain: list[dict[str, Ranked | None]] = []
    for number, found in enumerate(spread(_fit_plain, groups)):
        plain.append(found)
        tell("ranking", (number + 1) / len(groups) / 2)
    ranked = [r for found in plain for r in found.values() if r is not None]
    if not ranked:
        return []
    top = max(r.log_evidence for r in ranked)
    tasks = []
    for group, found in zip(groups, plain, strict=True):
        worth = top - PROMISING if _hopeful(found, top) else np.inf
        worth = -np.inf if any(always(s) for s in group.values()) else worth
        tasks.append((group, found.get(FREE), worth, seed))
    for number, rated in enumerate(spread(_fit_rates, tasks)):
        ranked += rated
        tell("ranking", 0.5 + (number + 1) / len(tasks) / 2)
    ranked = _searched_again(spread, ranked, seed)
    top = max(r.log_evidence for r in ranked)
    wanted = [
        i
        for i, r in enumerate(ranked)
        if r.log_evidence >= top - (NEAR if len(r.best.u) < SETTLES else LEADING) or always(r.simulation)
    ]
    free = _free(ranked)
    asked = [
        (ranked[i], free(ranked[i]), top - (CHEAP if _cheap(ranked[i]) else CLOSE), seed) for i in wanted
    ]
    for number, (i, better) in enumerate(zip(wanted, spread(integrated, asked), strict=True)):
        ranked[i] = better
        tell("integrating", (number + 1) / len(wanted))
    return sorted(ranked, key=lambda r: -r.log_evidence)


def _cheap(ranked: Ranked) -> bool:
    """Whether the evidence is that of rates alone."""
    return ranked.simulation.law == EACH and len(ranked.best.u) > SETTLES


def _searched_again(spread: Spread, ranked: list[Ranked], seed: int) -> list[Ranked]:
    """The models whose many rates could yet make them the best, with the best of further searches.

    Their modes are too many for any one search to find the best.
    """
    close = max(r.log_evidence for r in ranked) - NEAR
    wanted = [i for i, r in enumerate(ranked) if r.simulation.law == EACH and r.log_evidence >= close]
    free, first = _free(ranked), 1 + (1 + AGAIN) * seed
    tasks = [(ranked[i], free(ranked[i]), first + n) for i in wanted for n in range(AGAIN)]
    found = list(spread(_search_again, tasks))
    for number, i in enumerate(wanted):
        ranked[i] = max([ranked[i], *found[number * AGAIN : (number + 1) * AGAIN]], key=_evidence)
    return ranked


def _free(ranked: list[Ranked]) -> Callable[[Ranked], Ranked | None]:
    """Finds the model that is the same but for moduli free at each level."""
    free = {r.simulation.model_dump_json(): r for r in ranked if r.simulation.law == FREE}
    return lambda r: free.get(r.simulation.model_copy(update={"law": FREE}).model_dump_json())


def blueprint_of(problem: Problem, simulation: Simulation) -> Blueprint:
    """The problem's blueprint with another simulation."""
    return problem.blueprint.model_copy(update={"simulation": simulation})


def fitted(
    problem: Problem,
    simulation: Simulation,
    free: Ranked | None = None,
    worth: float = -np.inf,
    seed: int = 0,
    near: Ranked | None = None,
) -> Ranked | None:
    """A model with Laplace's evidence; None where no climb ends.

    ``free`` is the same model with moduli free at each level, which a law with rates starts from; their
    further modes are looked for where about this evidence (nats) makes it ``worth`` while. ``near`` is a
    model with the same parameters, which the climbs start from.
    """
    if rate_names(simulation.law, simulation.order) and free is None:
        free = fitted(problem, simulation.model_copy(update={"law": FREE}))
    with warnings.catch_warnings():
        # Where a model is hopeless, its misfit outweighs every prior: nothing to be warned of.
        warnings.simplefilter("ignore", linalg.LinAlgWarning)
        fits = _climbs(problem, simulation, free, worth, seed, near)
    return _ranked(problem, simulation, fits) if fits else None


def _ranked(problem: Problem, simulation: Simulation, fits: list[Fit]) -> Ranked:
    terms = [f.log_share for f in fits]
    n = len(problem)
    reached = [-0.5 * (f.chi2 + problem.log_dets[f.size] + n * log(2.0 * pi)) for f in fits]
    return Ranked(simulation, fits, float(np.logaddexp.reduce(terms)), ceiling=max(reached))


def integrated(task: tuple[Ranked, Ranked | None, float, int]) -> Ranked:
    """The model with its evidence by quadrature or annealing; what takes long, if ``worth`` it (nats).

    ``free`` is the same model with moduli free at each level.
    """
    ranked, free, worth, seed = task
    problem = held_problem()
    blueprint = blueprint_of(problem, ranked.simulation)
    rates = _rates_by_size(problem, ranked.simulation, free)
    value, error = log_evidence_beyond_laplace(problem, blueprint, ranked.fits, worth, rates, seed)
    return replace(ranked, log_evidence=value, error=error)


def _climbs(
    problem: Problem,
    simulation: Simulation,
    free: Ranked | None,
    worth: float,
    seed: int,
    near: Ranked | None,
) -> list[Fit]:
    """The best fit for each size of the remainder, from the largest down to where they have no more to say.

    Rates are looked for with the largest remainder, which smooths, and go on from there to the others.
    """
    blueprint = blueprint_of(problem, simulation)
    targets = _rates_by_size(problem, simulation, free)
    telling = max((t.fit.log_evidence for t in targets.values()), default=0.0) - SMOOTHED
    like = {} if near is None else {f.size: f for f in near.fits}
    found: dict[int, Fit] = {}
    known: Array | None = None
    for size in reversed(range(len(SIZES))):
        start = _at(found.get(size + 1, like.get(size)))
        try:
            if size in targets:
                wanted = worth if targets[size].fit.log_evidence >= telling else np.inf
                if known is None or wanted < np.inf:
                    known = find_rates(targets[size], known, wanted, seed)
                start = targets[size].start(known[0])
            new = fit(problem, frozenset(), size, start, blueprint)
        except np.linalg.LinAlgError:
            continue
        found[size] = new
        if known is not None:
            known = np.concatenate([new.u[None, -known.shape[1] :], known])
        if new.log_evidence < max(f.log_evidence for f in found.values()) - SILENT:
            break
    return [found[size] for size in sorted(found)]


def _at(found: Fit | None) -> Start:
    """Where another fit of the same model ended."""
    return {} if found is None else found.ended


def _rates_by_size(problem: Problem, simulation: Simulation, free: Ranked | None) -> dict[int, Rates]:
    """What the free moduli say of the rates, by size of the remainder; only where they say anything.

    Of readings at L0 alone engineering strain leaves nothing.
    """
    if free is None or not rate_names(simulation.law, simulation.order):
        return {}
    law, other = (
        chain_for(blueprint_of(problem, s).model_dump_json(), frozenset())
        for s in (simulation, free.simulation)
    )
    found = {f.size: Rates(law, other, f) for f in free.fits}
    return {size: rates for size, rates in found.items() if len(rates.seen[1])}


def _by_law(space: Sequence[Simulation]) -> list[dict[str, Simulation]]:
    """Models that differ in their law alone, by their law."""
    groups: dict[str, dict[str, Simulation]] = {}
    for simulation in space:
        key = simulation.model_copy(update={"law": "linear"}).model_dump_json()
        groups.setdefault(key, {})[simulation.law] = simulation
    return list(groups.values())


def _fit_plain(group: dict[str, Simulation]) -> dict[str, Ranked | None]:
    """The laws without rates of a group."""
    problem = held_problem()
    found: dict[str, Ranked | None] = {}
    near: Ranked | None = None
    for law, simulation in group.items():
        if law not in (SHARED, EACH):
            found[law] = fitted(problem, simulation, near=near)
            near = found[law] or near
    return found


def _fit_rates(task: tuple[dict[str, Simulation], Ranked | None, float, int]) -> list[Ranked]:
    """The laws with rates of a group; ``free`` is the group's free law, ``worth`` as in :func:`fitted`."""
    group, free, worth, seed = task
    problem = held_problem()
    found: list[Ranked] = []
    for law in (SHARED, EACH):
        if law in group:
            all_said = free is not None and bool(found) and _says_all(found[0], free)
            rated = fitted(problem, group[law], free, np.inf if all_said else worth, (1 + AGAIN) * seed)
            found += [] if rated is None else [rated]
    return found


def _search_again(task: tuple[Ranked, Ranked | None, int]) -> Ranked:
    """The better of a model and what another search for its rates finds."""
    before, free, seed = task
    problem = held_problem()
    again = fitted(problem, before.simulation, free, seed=seed)
    if again is None:
        return before
    fits = {f.size: f for f in before.fits}
    for f in again.fits:
        if f.size not in fits or f.log_evidence > fits[f.size].log_evidence:
            fits[f.size] = f
    return _ranked(problem, before.simulation, [fits[size] for size in sorted(fits)])


def _evidence(ranked: Ranked) -> float:
    return ranked.log_evidence


def _says_all(law: Ranked, free: Ranked) -> bool:
    """Whether moduli free at each level fit no better than their number makes them: no other law can then."""
    extra = max(len(free.best.eta) - len(law.best.eta) - len(law.best.u) + len(free.best.u), 1)
    return 2.0 * (free.ceiling - law.ceiling) < extra + CHANCE * sqrt(2.0 * extra)


def _hopeful(plain: dict[str, Ranked | None], top: float) -> bool:
    """Whether rates could bring a group near the top.

    No law of pressure fits the levels better than moduli of each level's own, and no evidence is above the
    best likelihood.
    """
    free = plain.get(FREE)
    if free is None:
        return True
    return free.ceiling >= top - LEADING
