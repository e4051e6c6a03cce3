"""Which simulation do the data ask for: order, law, friction, kinematics and strain convention ranked.

By evidence (summed over the remainder's sizes) and by whole pressure levels held out; with a confusion
matrix that says how often the leading models would be told apart with data like these. Laplace's evidence
ranks the whole space, quadrature those near the top, and bridge sampling gives the leading ones an error.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import product
from math import log
from multiprocessing import get_context

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.criticism.evidence import (
    WIDTHS,
    Weighed,
    log_evidence_by_quadrature,
    prior_sensitivity,
    weigh,
)
from mpam_calib.criticism.fit import Fit, fit
from mpam_calib.criticism.gain import FOLDS, log_density, predict_rows
from mpam_calib.criticism.problem import SIZE_PRIOR, SIZES, Problem, build_problem
from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import Blueprint, MaterialPosterior, Options, draw_blueprint
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import Specimen

Array = NDArray[np.float64]

ORDERS = range(1, 7)
LAWS = {"constant": 1, "linear": 2, "exponential": 3, "free": 2}
"""Laws and the levels that each needs."""
HELD_OUT = 24
"""Leading models that are also judged by held-out levels."""
CONFUSED = 5
"""Leading models that are told apart, bridged and tried under other priors."""
NEAR = 20.0
"""Nats below the best within which Laplace's evidence is replaced by quadrature."""
STARTS: dict[str, tuple[dict[str, float], ...]] = {
    "exponential": ({}, {"d": 1.0, "gap": -1.0}, {"d": -1.0, "gap": -1.0})
}
COLUMNS = [
    "kinematics", "strain", "order", "law", "friction", "effects", "n_parameters", "log_evidence",
    "log_evidence_se", "probability", "rmse_held_out_N", "elpd_held_out", "elpd_held_out_se",
]  # fmt: skip


@dataclass(frozen=True)
class Selection:
    """``models`` with the columns of ``models.csv`` (best first) and more about the leading ones.

    ``confusion`` (k, k): share of replicates simulated from row's model in which column's won.
    ``sensitivity``: their evidences and shares under other prior widths, a row for each model and width.
    ``disagreement`` (nats): the largest difference between quadrature and bridge among them.
    """

    models: pd.DataFrame
    confusion: Array
    replicates: int
    sensitivity: pd.DataFrame
    disagreement: float


@dataclass(frozen=True)
class _Ranked:
    simulation: Simulation
    fits: list[Fit]
    log_evidence: float
    error: float = float("nan")
    """Standard error of the evidence (nats), where a bridge gave one."""

    @property
    def best(self) -> Fit:
        return max(self.fits, key=lambda f: f.log_evidence + log(SIZE_PRIOR[f.size]))


def model_space(specimen: Specimen) -> list[Simulation]:
    """Every simulation that the specimen's files could carry (its effects and moduli's source kept)."""
    declared = specimen.simulation
    frictions = ["none"]
    parts = [p for p in (specimen.loops, specimen.force_map) if p is not None]
    if any(np.any(p.branch == 1) and np.any(p.branch == -1) for p in parts):
        frictions = ["coulomb", "none"] + (["strand"] if specimen.braid is not None else [])
    orders: list[int] = list(ORDERS)
    laws = [law for law, needed in LAWS.items() if len(specimen.levels_Pa) >= needed]
    strains = ["engineering", "stretch"]
    if declared.moduli != "loops":
        orders, laws, strains = [declared.order], ["constant"], [declared.strain]
    kinematics = ["inextensible_braid", "constant_thickness"]
    return [
        declared.model_copy(
            update={"kinematics": k, "strain": s, "order": m, "law": w, "friction": f}
            | ({"friction_by_pressure": False} if f != declared.friction else {})
        )
        for k, s, m, w, f in product(kinematics, strains, orders, laws, frictions)
    ]


def select(
    specimen: Specimen,
    *,
    seed: int = 0,
    replicates: int = 8,
    material: MaterialPosterior | None = None,
    tell: Callable[[str, float], None] | None = None,
) -> Selection:
    """Rank the model space on a specimen's recordings; raises ``InputError`` without muscle data."""
    if specimen.loops is None and specimen.force_map is None:
        raise InputError(specimen.folder / "specimen.toml", "no loops and no force map", "one to select on")
    listener = tell or (lambda stage, share: None)
    blueprint = draw_blueprint(specimen, Options(nuisances=False, remainder=False), material)
    problem = build_problem(specimen, blueprint)
    assert len(problem.axes[1]) == len(problem.bow)  # both are there before the workers are forked
    space = model_space(specimen)
    ranked: list[_Ranked] = []
    with ProcessPoolExecutor(
        2, mp_context=get_context("fork"), initializer=_hold, initargs=(problem,)
    ) as pool:
        for number, item in enumerate(pool.map(_rank, space, chunksize=4)):
            listener("ranking", (number + 1) / len(space))
            if item is not None:
                ranked.append(item)
        listener("integrating", 0.0)
        near = max(r.log_evidence for r in ranked) - NEAR
        ranked = list(pool.map(_integrate, ranked, [near] * len(ranked), chunksize=4))
        ranked.sort(key=lambda r: -r.log_evidence)
        weighed = list(pool.map(_weigh, ranked[:CONFUSED], [seed] * CONFUSED))
        ranked[:CONFUSED] = [_bridged(r, w) for r, w in zip(ranked, weighed, strict=False)]
        ranked.sort(key=lambda r: -r.log_evidence)
        listener("other priors", 0.0)
        widened = np.array(list(pool.map(_widen, ranked[:CONFUSED])))
        listener("holding out", 0.0)
        held = list(pool.map(_hold_out, ranked[:HELD_OUT]))
        listener("confusion", 0.0)
        leading = ranked[:CONFUSED]
        tasks = [(r, leading, seed, number, replicates) for number, r in enumerate(leading)]
        confusion = np.array(list(pool.map(_confuse, tasks)))
    return Selection(
        models=_table(ranked, held),
        confusion=confusion,
        replicates=replicates,
        sensitivity=prior_sensitivity(widened),
        disagreement=max(abs(w.quadrature - w.bridge.value) for w in weighed),
    )


_PROBLEM: Problem | None = None


def _hold(problem: Problem) -> None:
    global _PROBLEM
    _PROBLEM = problem


def _held() -> Problem:
    assert _PROBLEM is not None
    return _PROBLEM


def _blueprint(problem: Problem, simulation: Simulation) -> Blueprint:
    return problem.blueprint.model_copy(update={"simulation": simulation})


def _rank(simulation: Simulation, problem: Problem | None = None) -> _Ranked | None:
    problem = problem or _held()
    blueprint = _blueprint(problem, simulation)
    fits: list[Fit] = []
    for size in range(len(SIZES)):
        tried = []
        for start in STARTS.get(simulation.law, ({},)):
            try:
                tried.append(fit(problem, frozenset(), size, start, blueprint))
            except np.linalg.LinAlgError:
                continue
        if tried:
            fits.append(max(tried, key=lambda f: f.log_evidence))
    if not fits:
        return None
    terms = [f.log_evidence + log(SIZE_PRIOR[f.size]) for f in fits]
    return _Ranked(simulation, fits, float(np.logaddexp.reduce(terms)))


def _integrate(ranked: _Ranked, near: float) -> _Ranked:
    if ranked.log_evidence < near:
        return ranked
    problem = _held()
    blueprint = _blueprint(problem, ranked.simulation)
    return replace(ranked, log_evidence=log_evidence_by_quadrature(problem, blueprint, ranked.fits))


def _weigh(ranked: _Ranked, seed: int) -> Weighed:
    problem = _held()
    return weigh(problem, _blueprint(problem, ranked.simulation), ranked.fits, seed)


def _bridged(ranked: _Ranked, weighed: Weighed) -> _Ranked:
    """The bridge's figure with its error, where it is to be believed."""
    if not weighed.bridge.reliable:
        return ranked
    return replace(ranked, log_evidence=weighed.bridge.value, error=weighed.bridge.error)


def _widen(ranked: _Ranked) -> list[float]:
    """Log evidence for each of WIDTHS."""
    problem = _held()
    blueprint = _blueprint(problem, ranked.simulation)
    return [log_evidence_by_quadrature(problem, blueprint, ranked.fits, w) for w in WIDTHS.values()]


def _hold_out(ranked: _Ranked) -> tuple[float, float, float]:
    """RMSE (N), joint log predictive density and its standard error over folds of whole levels."""
    problem = _held()
    labels = np.unique(problem.level)
    if len(labels) < 3:
        return float("nan"), float("nan"), float("nan")
    blueprint = _blueprint(problem, ranked.simulation)
    size = ranked.best.size
    start = dict(zip(ranked.best.names, ranked.best.u.tolist(), strict=True))
    squares, densities = [], []
    for i in range(min(FOLDS, len(labels))):
        held = np.isin(problem.level, labels[i::FOLDS])
        index = (np.flatnonzero(~held), np.flatnonzero(held))
        try:
            fitted = fit(problem.take(~held), frozenset(), size, start, blueprint)
            mean, covariance = predict_rows(problem, fitted, index, blueprint)
            residual = problem.force[held] - mean
            densities.append(log_density(residual, covariance))
        except np.linalg.LinAlgError:
            return float("nan"), float("nan"), float("nan")
        squares.append(residual**2)
    error = float(np.sqrt(len(densities)) * np.std(densities, ddof=1))
    return float(np.sqrt(np.mean(np.concatenate(squares)))), float(np.sum(densities)), error


def _confuse(task: tuple[_Ranked, list[_Ranked], int, int, int]) -> Array:
    """Shares in which each leading model wins on data simulated from one of them."""
    truth, leading, seed, number, replicates = task
    problem = _held()
    rng = np.random.default_rng([seed, 10, number])
    root = np.linalg.cholesky(problem.noise)
    wins = np.zeros(len(leading))
    for _ in range(replicates):
        force = truth.best.force + root @ rng.standard_normal(len(problem))
        made = replace(problem, force=force)
        # The covariance does not depend on the forces: its factors are taken over.
        made.__dict__.update({k: problem.__dict__[k] for k in ("roots", "log_dets") if k in problem.__dict__})
        scores = [_rank(r.simulation, made) for r in leading]
        wins[int(np.argmax([-np.inf if s is None else s.log_evidence for s in scores]))] += 1.0
    return wins / replicates


def _table(ranked: list[_Ranked], held: list[tuple[float, float, float]]) -> pd.DataFrame:
    evidence = np.array([r.log_evidence for r in ranked])
    probability = np.exp(evidence - evidence.max())
    probability /= probability.sum()
    blank = (float("nan"),) * 3
    rows = []
    for number, (r, share) in enumerate(zip(ranked, probability, strict=True)):
        s = r.simulation
        rmse, elpd, error = held[number] if number < len(held) else blank
        effects = " ".join(s.effects)
        count = len(r.best.u) + len(r.best.eta)
        rows.append(
            [s.kinematics, s.strain, s.order, s.law, s.friction, effects, count, r.log_evidence, r.error,
             share, rmse, elpd, error]
        )  # fmt: skip
    return pd.DataFrame(rows, columns=COLUMNS)
