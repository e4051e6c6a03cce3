"""Which simulation do the data ask for: order, law, friction, kinematics and strain convention ranked.

By evidence (summed over the remainder's sizes) and by whole pressure levels held out; with a confusion
matrix that says how often the leading models would be told apart with data like these. Laplace's evidence
ranks the whole space, quadrature or annealing those near the top, and bridge sampling gives the leading
ones an error.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.fitting.noise_scale import settle_noise
from mpam_calib.criticism.selection.evidence import (
    Weighed,
    many_parameters,
    prior_sensitivity,
    under_other_priors,
    weigh,
)
from mpam_calib.criticism.selection.held_out import LEVEL_COLUMNS, hold_out, hold_out_each
from mpam_calib.criticism.selection.odds import declared_or_beside, odds
from mpam_calib.criticism.selection.ranking import Ranked, blueprint_of, fitted, rank_spread
from mpam_calib.criticism.selection.space import model_space
from mpam_calib.criticism.tasks.journal import Journal, journalled
from mpam_calib.criticism.tasks.spread import Spread, held_problem
from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import MaterialPosterior, Options, draw_blueprint
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import Specimen

Array = NDArray[np.float64]

HELD_OUT = 24
"""Leading models that are also judged by held-out levels."""
CONFUSED = 5
"""Leading models that are told apart, bridged and tried under other priors."""
COLUMNS = [
    "kinematics", "strain", "order", "law", "friction", "effects", "n_parameters", "log_evidence",
    "log_evidence_se", "probability", "rmse_held_out_N", "elpd_held_out", "elpd_held_out_se",
]  # fmt: skip


@dataclass(frozen=True)
class Selection:
    """``models`` with the columns of ``models.csv`` (best first) and more about the leading ones.

    ``odds`` has a row for each order, law, friction ... (:func:`mpam_calib.criticism.selection.odds.odds`).
    ``levels``: each level predicted from the others by the first model, by the one with the best density at
    levels left out and by the declared one (``model``: "first", "held out", "declared"; then LEVEL_COLUMNS).
    ``confusion`` (k, k): share of replicates simulated from row's model in which column's won; NaN where
    there were none. ``sensitivity``: their evidences and shares under other prior widths, a row for each
    model and width. ``disagreement`` (nats): the largest difference between quadrature and bridge among them;
    NaN where none was bridged.
    """

    models: pd.DataFrame
    odds: pd.DataFrame
    levels: pd.DataFrame
    confusion: Array
    replicates: int
    sensitivity: pd.DataFrame
    disagreement: float
    noise_guess: float | None = None
    """Noise (N) that was settled from a guess: none is declared, and the readings are too few to tell it."""


def select(
    specimen: Specimen,
    *,
    seed: int = 0,
    replicates: int = 8,
    material: MaterialPosterior | None = None,
    tell: Callable[[str, float], None] | None = None,
    workers: int = 2,
    journal: Journal | None = None,
) -> Selection:
    """Rank the model space on a specimen's recordings; raises ``InputError`` without muscle data.

    ``replicates`` is how many sets of loops are simulated from each leading model for the confusion matrix.
    What is in the ``journal`` of an interrupted selection of the same specimen is not done again.
    """
    if specimen.loops is None and specimen.force_map is None:
        raise InputError(specimen.folder / "specimen.toml", "no loops and no force map", "one to select on")
    listener = tell or (lambda stage, share: None)
    declared = specimen.simulation
    blueprint = draw_blueprint(specimen, Options(nuisances=False, remainder=False), material)
    space = model_space(specimen)
    problem = settle_noise(build_problem(specimen, blueprint), space)
    with journalled(problem, workers, journal) as spread:
        ranked = rank_spread(
            spread,
            space,
            tell=listener,
            always=lambda simulation: declared_or_beside(simulation, declared),
            seed=seed,
        )
        if not ranked:
            raise InputError(
                specimen.folder / "specimen.toml", "data that none of the models can be fitted to", "others"
            )
        ranked, widened, disagreement = _leading_weighed(spread, ranked, seed, listener)
        leading = ranked[:CONFUSED]
        listener("holding out", 0.0)
        held = list(spread(hold_out, ranked[:HELD_OUT]))
        chosen = _apart(ranked, held, declared)
        apart = dict(zip(chosen, spread(hold_out_each, chosen.values()), strict=True))
        listener("confusion", 0.0)
        tasks = [(r, leading, seed, number, replicates) for number, r in enumerate(leading)]
        confusion = np.array(list(spread(_confuse, tasks)))
    models = _table(ranked, held)
    return Selection(
        models=models,
        odds=odds(models, declared),
        levels=_levels(apart),
        confusion=confusion,
        replicates=replicates,
        sensitivity=prior_sensitivity(widened),
        disagreement=disagreement,
        noise_guess=float(np.sqrt(problem.noise[0, 0])) if problem.noise_guessed else None,
    )


def _leading_weighed(
    spread: Spread, ranked: list[Ranked], seed: int, tell: Callable[[str, float], None]
) -> tuple[list[Ranked], Array, float]:
    """All models with the leading ones bridged, best first; these under other priors; the disagreement."""
    tell("bridging", 0.0)
    weighed = list(spread(_weigh, [(r, seed) for r in ranked[:CONFUSED]]))
    known = {r.simulation.model_dump_json(): w.quadrature for r, w in zip(ranked, weighed, strict=False)}
    bridged = [_bridged(r, w) for r, w in zip(ranked, weighed, strict=False)]
    ranked = sorted([*bridged, *ranked[CONFUSED:]], key=lambda r: -r.log_evidence)
    tell("other priors", 0.0)
    leading = ranked[:CONFUSED]
    before = [known.get(r.simulation.model_dump_json(), r.log_evidence) for r in leading]
    widened = spread(_widen, [(r, value, seed) for r, value in zip(leading, before, strict=True)])
    differences = (w.difference for w in weighed if np.isfinite(w.difference))
    return ranked, np.array(list(widened)), max(differences, default=float("nan"))


def _weigh(task: tuple[Ranked, int]) -> Weighed:
    ranked, seed = task
    if many_parameters(ranked.fits):
        return Weighed(ranked.log_evidence, ranked.error, None)
    problem = held_problem()
    return weigh(problem, blueprint_of(problem, ranked.simulation), ranked.fits, seed)


def _bridged(ranked: Ranked, weighed: Weighed) -> Ranked:
    """The bridge's figure with its error where it is to be believed, or else the quadrature's without.

    One that has no bridge stays as it is.
    """
    if weighed.bridge is None:
        return ranked
    if not weighed.agrees:
        return replace(ranked, log_evidence=weighed.quadrature, error=float("nan"))
    return replace(ranked, log_evidence=weighed.bridge.value, error=weighed.bridge.error)


def _widen(task: tuple[Ranked, float, int]) -> list[float]:
    """Log evidence for each of WIDTHS; ``known`` is that under the declared ones."""
    ranked, known, seed = task
    problem = held_problem()
    return under_other_priors(problem, blueprint_of(problem, ranked.simulation), ranked.fits, known, seed)


def _confuse(task: tuple[Ranked, list[Ranked], int, int, int]) -> Array:
    """Shares in which each leading model wins on data simulated from one of them."""
    truth, leading, seed, number, replicates = task
    if replicates == 0:
        return np.full(len(leading), np.nan)
    problem = held_problem()
    rng = np.random.default_rng([seed, 10, number])
    root = np.linalg.cholesky(problem.noise)
    wins = np.zeros(len(leading))
    for _ in range(replicates):
        made = problem.with_force(truth.best.force + root @ rng.standard_normal(len(problem)))
        scores = [fitted(made, r.simulation) for r in leading]
        wins[int(np.argmax([-np.inf if s is None else s.log_evidence for s in scores]))] += 1.0
    return wins / replicates


def _apart(
    ranked: list[Ranked], held: list[tuple[float, float, float]], declared: Simulation
) -> dict[str, Ranked]:
    """The models whose levels are looked at one by one."""
    density = np.array([elpd for _, elpd, _ in held])
    found = {"first": ranked[0]}
    if np.isfinite(density).any():
        found["held out"] = ranked[int(np.nanargmax(density))]
    own = [r for r in ranked if r.simulation == declared]
    if own:
        found["declared"] = own[0]
    return found


def _levels(apart: dict[str, pd.DataFrame]) -> pd.DataFrame:
    parts = [frame.assign(model=name) for name, frame in apart.items()]
    return pd.concat(parts, ignore_index=True)[["model", *LEVEL_COLUMNS]]


def _table(ranked: list[Ranked], held: list[tuple[float, float, float]]) -> pd.DataFrame:
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
