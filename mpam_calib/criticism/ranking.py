"""A space of models ranked by evidence: Laplace's for all of them, quadrature for those near the top.

The evidence of a model is summed over the remainder's sizes. Models that differ in their law alone are
fitted one after the other: a law with rates of its own for each modulus starts its climb where the law with
shared rates ended.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import log, pi, sqrt

import numpy as np
from scipy import linalg

from mpam_calib.criticism.evidence import log_evidence_by_quadrature
from mpam_calib.criticism.fit import Fit, fit
from mpam_calib.criticism.noise_scale import settle_noise
from mpam_calib.criticism.problem import SIZE_PRIOR, SIZES, Problem
from mpam_calib.criticism.spread import Spread, held_problem, spread_over
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.moduli import rate_names
from mpam_calib.specimen.declaration import Simulation

NEAR = 10.0
"""Nats below the best within which Laplace's evidence is replaced by quadrature."""
SILENT = 300.0
"""Nats below a larger remainder at which still smaller ones are not tried."""
CHANCE = 3.0
"""Standard deviations of chi-squared beyond which a better fit is no chance."""
SHARED, EACH = "exponential", "exponential_each"
STARTS: dict[str, tuple[dict[str, float], ...]] = {
    SHARED: ({"d": 1.0, "gap": -1.0}, {"d": -1.0, "gap": -1.0})
}
"""Coordinates from which a law's climbs start, besides the middle of the priors."""

Start = dict[str, float]


@dataclass(frozen=True)
class Ranked:
    """A model with its fits (one for each size of the remainder) and its log evidence (nats).

    ``error`` is the evidence's standard error, where a bridge gave one.
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
        return max(self.fits, key=lambda f: f.log_evidence + log(SIZE_PRIOR[f.size]))


def rank(problem: Problem, space: Sequence[Simulation], *, workers: int = 2) -> list[Ranked]:
    """The models of a space, most evidence first; those that cannot be fitted are left out.

    Those within NEAR nats of the best have their evidence by quadrature, the others by Laplace's
    approximation. The noise is settled first (:mod:`mpam_calib.criticism.noise_scale`). One worker means
    this process.
    """
    with spread_over(settle_noise(problem, space), workers) as spread:
        return rank_spread(spread, space)


def rank_spread(
    spread: Spread,
    space: Sequence[Simulation],
    *,
    tell: Callable[[str, float], None] = lambda stage, share: None,
    always: Callable[[Simulation], bool] = lambda simulation: False,
) -> list[Ranked]:
    """:func:`rank` by workers that hold the problem; ``always`` names models that are integrated anyhow."""
    groups = _by_law(space)
    plain: list[dict[str, Ranked | None]] = []
    for number, found in enumerate(spread(_fit_plain, groups, 4)):
        plain.append(found)
        tell("ranking", (number + 1) / len(groups) / 2)
    ranked = [r for found in plain for r in found.values() if r is not None]
    if not ranked:
        return []
    top = max(r.log_evidence for r in ranked)
    tasks = [
        (group, found.get("free"), _hopeful(found, top) or any(always(s) for s in group.values()))
        for group, found in zip(groups, plain, strict=True)
    ]
    for number, rated in enumerate(spread(_fit_rates, tasks)):
        ranked += rated
        tell("ranking", 0.5 + (number + 1) / len(tasks) / 2)
    near = max(r.log_evidence for r in ranked) - NEAR
    wanted = [i for i, r in enumerate(ranked) if r.log_evidence >= near or always(r.simulation)]
    for number, (i, better) in enumerate(
        zip(wanted, spread(integrated, [ranked[i] for i in wanted]), strict=True)
    ):
        ranked[i] = better
        tell("integrating", (number + 1) / len(wanted))
    return sorted(ranked, key=lambda r: -r.log_evidence)


def blueprint_of(problem: Problem, simulation: Simulation) -> Blueprint:
    """The problem's blueprint with another simulation."""
    return problem.blueprint.model_copy(update={"simulation": simulation})


def fitted(
    problem: Problem, simulation: Simulation, shared: Ranked | None = None, thorough: bool = True
) -> Ranked | None:
    """A model with Laplace's evidence; None where no climb ends.

    ``shared`` is the same model with rates that all moduli share, for a law with rates of their own. A
    ``thorough`` search for the rates takes several ways.
    """
    if simulation.law == EACH and shared is None:
        shared = fitted(problem, simulation.model_copy(update={"law": SHARED}))
    with warnings.catch_warnings():
        # Where a model is hopeless, its misfit outweighs every prior: nothing to be warned of.
        warnings.simplefilter("ignore", linalg.LinAlgWarning)
        fits = _climbs(problem, simulation, shared, thorough)
    if not fits:
        return None
    terms = [f.log_evidence + log(SIZE_PRIOR[f.size]) for f in fits]
    n = len(problem)
    reached = [-0.5 * (f.chi2 + problem.log_dets[f.size] + n * log(2.0 * pi)) for f in fits]
    return Ranked(simulation, fits, float(np.logaddexp.reduce(terms)), ceiling=max(reached))


def integrated(ranked: Ranked) -> Ranked:
    """The model with its evidence by quadrature, on the held problem."""
    problem = held_problem()
    value = log_evidence_by_quadrature(problem, blueprint_of(problem, ranked.simulation), ranked.fits)
    return replace(ranked, log_evidence=value)


def _climbs(problem: Problem, simulation: Simulation, shared: Ranked | None, thorough: bool) -> list[Fit]:
    """The best fit for each size of the remainder, from the largest down to where they have no more to say.

    Rates are found on the way down, which the larger remainder smooths; then back, each from the mode that
    the size before it has.
    """
    blueprint = blueprint_of(problem, simulation)
    found: dict[int, Fit] = {}

    def climb(size: int, starts: list[Start]) -> None:
        for start in starts:
            try:
                new = fit(problem, frozenset(), size, start, blueprint)
            except np.linalg.LinAlgError:
                continue
            if size not in found or new.log_evidence > found[size].log_evidence:
                found[size] = new

    rates = rate_names(simulation.law, simulation.order)
    for size in reversed(range(len(SIZES))):
        starts = _from_shared(shared, simulation, size)
        if thorough or not starts:
            starts += _at(found.get(size + 1)) if rates else []
        if not starts:
            starts = [{}, *(STARTS.get(simulation.law, ()) if thorough else ())]
        elif rates and thorough and not found:
            starts.append({})
        climb(size, starts)
        if size in found and found[size].log_evidence < max(f.log_evidence for f in found.values()) - SILENT:
            break
    for size in sorted(found)[1:] if rates and thorough else ():
        climb(size, _at(found.get(size - 1)))
    return [found[size] for size in sorted(found)]


def _at(found: Fit | None) -> list[Start]:
    """The start that another fit of the same model gives."""
    return [] if found is None else [dict(zip(found.names, found.u.tolist(), strict=True))]


def _from_shared(shared: Ranked | None, simulation: Simulation, size: int) -> list[Start]:
    """The start that the shared rates' fit gives for this size of the remainder."""
    if simulation.law != EACH or shared is None:
        return []
    rates = rate_names(EACH, simulation.order)
    starts = [start for f in shared.fits if f.size == size for start in _at(f)]
    return [at | {name: at[name.split("_")[0]] for name in rates} for at in starts]


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
    return {law: fitted(problem, s) for law, s in group.items() if law not in (SHARED, EACH)}


def _fit_rates(task: tuple[dict[str, Simulation], Ranked | None, bool]) -> list[Ranked]:
    """The laws with rates of a group, searched thoroughly or not; ``free`` is the group's free law."""
    group, free, thorough = task
    problem = held_problem()
    found: dict[str, Ranked | None] = {}
    for law in (SHARED, EACH):
        if law in group:
            shared = found.get(SHARED)
            search = thorough and (free is None or shared is None or not _says_all(shared, free))
            found[law] = fitted(problem, group[law], shared, search)
    return [r for r in found.values() if r is not None]


def _says_all(law: Ranked, free: Ranked) -> bool:
    """Whether moduli free at each level fit no better than their number makes them: no other law can then."""
    extra = max(len(free.best.eta) - len(law.best.eta) - len(law.best.u) + len(free.best.u), 1)
    return 2.0 * (free.ceiling - law.ceiling) < extra + CHANCE * sqrt(2.0 * extra)


def _hopeful(plain: dict[str, Ranked | None], top: float) -> bool:
    """Whether rates could bring a group near the top.

    No law of pressure fits the levels better than moduli of each level's own, and no evidence is above the
    best likelihood.
    """
    free = plain.get("free")
    if free is None:
        return True
    return free.ceiling >= top - NEAR
