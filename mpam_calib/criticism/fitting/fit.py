"""One hypothesis, refitted exactly, and its evidence.

Sizes are sampler coordinates (standard normal priors), moduli the block's own; the evidence is Laplace's
with the Gauss-Newton Hessian. Effects may bring a doubt about their forms
(:mod:`mpam_calib.criticism.fitting.doubt`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import log

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from mpam_calib.criticism.data.problem import SIZE_PRIOR, Problem
from mpam_calib.criticism.fitting.climb import CONVERGED, Climb, Place, plus_one
from mpam_calib.criticism.fitting.doubt import doubts
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.chain import Chain
from mpam_calib.model.model import build_model
from mpam_calib.model.readings import Readings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Under:
    """What one doubt makes of the coordinates: its log evidence (nats), their mode (d,) and sds (d,)."""

    log_evidence: float
    u: Array
    sd: Array


@dataclass(frozen=True)
class Fit:
    """A refitted hypothesis: its effects, the remainder's size, coordinates and how good it is.

    ``u`` (d,), ``eta`` (p,) and the doubt's ``zeta`` (r,) at the mode with covariance (d + p + r, d + p + r);
    ``force`` (n,) the model's and ``doubt`` (n,) what the doubt adds, N; ``log_evidence`` in nats, summed
    over the doubts in play, of which ``doubt_sd`` is the likeliest; ``chi2`` the whitened sum of squares.
    ``under`` has the coordinates by every doubt in play.
    """

    effects: frozenset[str]
    size: int
    names: tuple[str, ...]
    u: Array
    eta: Array
    zeta: Array
    covariance: Array
    force: Array
    doubt: Array
    doubt_sd: float
    log_evidence: float
    chi2: float
    under: tuple[Under, ...]

    @property
    def ended(self) -> dict[str, float]:
        """Where the climb ended: sampler coordinates by name."""
        return dict(zip(self.names, self.u.tolist(), strict=True))

    @property
    def log_share(self) -> float:
        """Log evidence (nats) with the prior of the remainder's size: the fit's term of a sum over sizes."""
        return self.log_evidence + log(SIZE_PRIOR[self.size])

    @property
    def objective(self) -> float:
        """The log density at the mode, up to a constant of the problem and the remainder's size."""
        squares = self.u @ self.u + self.eta @ self.eta + self.zeta @ self.zeta
        return -0.5 * float(self.chi2 + squares)

    def draw(self, name: str, count: int, rng: np.random.Generator) -> Array:
        """Draws (count,) of one coordinate, every doubt in play by its probability.

        The likeliest doubt alone would be too sure: it may be none where a small one is nearly as likely.
        """
        i = self.names.index(name)
        log_evidence = np.array([d.log_evidence for d in self.under])
        mode = np.array([d.u[i] for d in self.under])
        sd = np.array([d.sd[i] for d in self.under])
        weights = np.exp(log_evidence - np.logaddexp.reduce(log_evidence))
        which = rng.choice(len(weights), size=count, p=weights / weights.sum())
        return np.asarray(mode[which] + sd[which] * rng.standard_normal(count))


def extended(blueprint: Blueprint, effects: frozenset[str]) -> Blueprint:
    """The blueprint with more effects declared."""
    simulation = blueprint.simulation
    listed = (*simulation.effects, *sorted(effects))
    return blueprint.model_copy(update={"simulation": simulation.model_copy(update={"effects": listed})})


@lru_cache(maxsize=4096)
def chain_for(key: str, effects: frozenset[str]) -> Chain:
    """The chain of a blueprint (as JSON) with more effects."""
    chain = build_model(extended(_blueprint_of(key), effects)).chain
    assert chain is not None
    return chain


@lru_cache(maxsize=8)
def _blueprint_of(key: str) -> Blueprint:
    return Blueprint.model_validate_json(key)


def doubt_columns(
    key: str, effects: frozenset[str], values: dict[str, Array], eta: Array, readings: Readings, guide: Array
) -> Array:
    """Columns (m, r), N, of the doubt about the effects' forms, for δ = 1: see :func:`doubt.doubts`."""
    without = {e: chain_for(key, effects - {e}) for e in effects}
    return doubts(chain_for(key, effects), without, values, eta, readings, guide)


def doubt_on_rows(
    problem: Problem, key: str, effects: frozenset[str], values: dict[str, Array], eta: Array, guide: Array
) -> Array:
    """The same columns on a problem's rows (n, r); ``guide`` (m,) is the force at its lean readings."""
    readings, first, second = problem.lean
    columns = doubt_columns(key, effects, values, eta, readings, guide)
    return 0.5 * (columns[first] + columns[second])


def doubt_about(problem: Problem, key: str, found: Fit) -> Array:
    """What the forms of a fit may get wrong: columns (n, r), N, at its mode, with coefficients N(0, 1)."""
    if found.doubt_sd == 0.0:
        return np.empty((len(problem), 0))
    chain, readings = chain_for(key, found.effects), problem.lean[0]
    values = {p.name: p.prior.from_normal(found.u[None, i : i + 1]) for i, p in enumerate(chain.parameters)}
    values = values or {"": np.zeros((1, 1))}
    force = chain.force(values, found.eta[None], readings)
    guide = np.broadcast_to(force, (1, len(readings)))[0]
    return found.doubt_sd * doubt_on_rows(problem, key, found.effects, values, found.eta, guide)


def by_equations(problem: Problem, found: Fit) -> Array:
    """Force (n,), N, of a fit's equations at their sizes, the moduli fitted to them alone.

    Free moduli lean on a doubt: without it they are others.
    """
    if found.doubt_sd == 0.0:
        return found.force
    chain = chain_for(problem.declared, found.effects)
    climb = Climb(problem, chain, found.size, np.empty((len(problem), 0)))
    p = chain.linear_size
    place = climb.look_with_its_signs(found.u, climb.guide(), np.zeros(p))
    return climb.look_with_its_signs(found.u, place.guide, place.eta[:p]).force


def fit(
    problem: Problem,
    effects: frozenset[str],
    size: int,
    start: dict[str, float] | None = None,
    blueprint: Blueprint | None = None,
    doubts: tuple[float, ...] = (),
    rival: float = -np.inf,
    converged: float = CONVERGED,
) -> Fit:
    """Refit the simulation with these effects against a remainder of SIZES[size].

    ``start`` gives coordinates by parameter name to start from (0 otherwise); ``blueprint`` another
    declared simulation than the problem's; ``doubts`` how far the effects' forms may be off, with equal
    prior probabilities (none: not at all); a climb without hope to come near the objective of a ``rival``
    ends early, and each where a round promises fewer nats than ``converged``. Raises ``LinAlgError`` where no
    climb from there ends.
    """
    key = problem.declared if blueprint is None else blueprint.model_dump_json()
    chain, n = chain_for(key, effects), len(problem)
    climb = Climb(problem, chain, size, np.empty((n, 0)), rival, converged)
    u = np.array([(start or {}).get(name, 0.0) for name in climb.names], dtype=np.float64)
    place = climb.climb(u, climb.guide(), np.zeros(chain.linear_size))
    plain = _fitted(effects, climb, place, 0.0)
    if not effects or not doubts:
        return plain
    # A doubt is in proportion to the sizes found so far; with it they settle once more.
    columns = doubt_on_rows(problem, key, effects, climb.values(place.u[None]), place.eta, place.guide)
    found = []
    for doubt in doubts:
        if doubt == 0.0:
            found.append(plain)
            continue
        climb = Climb(problem, chain, size, doubt * columns)
        place = climb.climb(place.u, place.guide, place.eta[: chain.linear_size])
        found.append(_fitted(effects, climb, place, doubt))
    evidence = np.logaddexp.reduce([f.log_evidence for f in found]) - np.log(len(found))
    under = tuple(d for f in found for d in f.under)
    return replace(max(found, key=lambda f: f.log_evidence), log_evidence=float(evidence), under=under)


def _fitted(effects: frozenset[str], climb: Climb, place: Place, doubt: float) -> Fit:
    """The fit at a mode, with Laplace's evidence; ``LinAlgError`` where the climb met no muscle at all."""
    if not np.isfinite(place.objective):
        raise np.linalg.LinAlgError(f"no force at the start of {sorted(effects)}")
    problem, p = climb.problem, climb.chain.linear_size
    eta, zeta = np.split(place.eta, [p])
    J = climb.slopes(place)
    hessian = plus_one(J.T @ J)
    factor = linalg.cho_factor(hessian, lower=True)
    log_det = 2.0 * float(np.sum(np.log(np.diagonal(factor[0]))))
    constant = problem.log_dets[climb.size] + len(problem) * np.log(2.0 * np.pi)
    log_evidence = float(place.objective - 0.5 * (constant + log_det))
    covariance = np.asarray(linalg.cho_solve(factor, np.eye(len(hessian))))
    sd = np.sqrt(np.diagonal(covariance)[: len(place.u)])
    return Fit(
        effects=effects,
        size=climb.size,
        names=climb.names,
        u=place.u,
        eta=eta,
        zeta=zeta,
        covariance=covariance,
        force=place.force,
        doubt=climb.extra @ zeta,
        doubt_sd=doubt,
        log_evidence=log_evidence,
        chi2=float(place.residual @ place.residual),
        under=(Under(log_evidence, place.u, sd),),
    )
