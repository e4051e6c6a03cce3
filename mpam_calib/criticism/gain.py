"""What the extended model gains on data the fit never saw: search, selection and fit inside every fold.

Folds are whole pressure levels, or whole cycles where the history is the cause or levels are too few.
Held-out rows are judged together: their joint predictive density knows that neighbours share the remainder
and the noise. With fewer rows a fold may recognise other causes: those named on all rows are refitted to each
fold, too.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.folds import FEWEST, Z90, folds_of, log_densities, total
from mpam_calib.criticism.fitting.predicted import predict_rows
from mpam_calib.criticism.fitting.refits import Set, causes_of
from mpam_calib.criticism.searching.candidates import HISTORY
from mpam_calib.criticism.searching.search import open_search
from mpam_calib.criticism.sizes import Sizes, sizes_of
from mpam_calib.criticism.tasks.journal import Journal
from mpam_calib.criticism.verdict import judge

Array = NDArray[np.float64]

FOLD_WIDTH = 3
OPEN = 0.01
"""Probability from which on a form is open."""


@dataclass(frozen=True)
class Gain:
    """Before: the declared simulation refitted in each fold. After: with the set that the fold chose.

    ``named``: with the causes that all rows name, refitted in each fold.
    """

    held_out: str
    rmse_before: float
    rmse_after: float
    rmse_named: float
    elpd_gain: float
    elpd_gain_se: float
    elpd_gain_named: float
    elpd_gain_named_se: float
    coverage90_before: float
    coverage90_after: float
    coverage90_named: float
    folds_same_set: int
    folds: int


@dataclass(frozen=True)
class _Fold:
    """Residuals (N), whether each lies in its band, log densities by what is left out (3, labels).

    Before, with what the fold chose, with the causes named.
    """

    residuals: list[Array]
    inside: list[NDArray[np.bool_]]
    elpd: Array
    chosen: Set


def measure_gain(
    problem: Problem,
    tested: tuple[str, ...],
    named: Fit,
    workers: int = 1,
    tell: Callable[[float], None] | None = None,
    journal: Journal | None = None,
) -> Gain | None:
    """The gain of the causes that were named, of which ``named`` is the fit to all rows.

    None where nothing can be held out. ``tell`` hears the share done.
    """
    causes = causes_of(named)
    cycles, levels = problem.cycles, np.unique(problem.level)
    told_by_cycles = bool(causes & set(HISTORY)) or _own_at_each_level(problem)
    by_cycle = len(cycles) >= FEWEST and (told_by_cycles or len(levels) < FEWEST)
    groups, labels = (problem.cycle, cycles) if by_cycle else (problem.level, levels)
    if len(labels) < FEWEST:
        return None
    parts, folds = folds_of(labels), []
    for part in parts:
        folds.append(_fold(problem, tested, named, groups, part, workers, journal))
        if tell is not None:
            tell(len(folds) / len(parts))
    errors = [
        float(np.sqrt(np.mean(np.concatenate(r) ** 2)))
        for r in zip(*(f.residuals for f in folds), strict=True)
    ]
    covered = [float(np.mean(np.concatenate(i))) for i in zip(*(f.inside for f in folds), strict=True)]
    before, *after = np.concatenate([f.elpd for f in folds], axis=1)
    (gained, gained_se), (named_gained, named_se) = (total(elpd - before) for elpd in after)
    return Gain(
        held_out="cycle" if by_cycle else "pressure",
        rmse_before=errors[0],
        rmse_after=errors[1],
        rmse_named=errors[2],
        elpd_gain=gained,
        elpd_gain_se=gained_se,
        elpd_gain_named=named_gained,
        elpd_gain_named_se=named_se,
        coverage90_before=covered[0],
        coverage90_after=covered[1],
        coverage90_named=covered[2],
        folds_same_set=sum(f.chosen == causes for f in folds),
        folds=len(folds),
    )


def _own_at_each_level(problem: Problem) -> bool:
    """Whether the simulation has moduli or friction of each level's own, which no other level predicts."""
    simulation = problem.blueprint.simulation
    return simulation.law == "free" or (simulation.friction != "none" and simulation.friction_by_pressure)


def _fold(
    problem: Problem,
    tested: tuple[str, ...],
    named: Fit,
    groups: NDArray[np.int64],
    part: NDArray[np.int64],
    workers: int,
    journal: Journal | None,
) -> _Fold:
    held = np.isin(groups, part)
    # Workers share one fold's search: three folds on two workers would leave one idle.
    with open_search(
        problem.take(~held), tested, width=FOLD_WIDTH, workers=workers, settle=False, journal=journal
    ) as found:
        # What a verdict on these rows alone would report: in "unexplained", only what stands even so.
        chosen = judge(found).standing
        found.refit_all((chosen, size) for size in range(len(SIZES)))
        in_forms = sizes_of(found, chosen)
        # In the forms of all rows: those that tell them apart may be the very rows held out.
        in_its_forms = found.refit_like(named)
    index = (np.flatnonzero(~held), np.flatnonzero(held))
    after = _over_forms(problem, in_forms, index)
    results = [
        predict_rows(problem, found.best_fit(frozenset()), index),
        after,
        # No climb may have an end without these rows.
        after if in_its_forms is None else predict_rows(problem, in_its_forms, index),
    ]
    residuals = [problem.force[held] - mean for mean, _ in results]
    covariances = [covariance for _, covariance in results]
    return _Fold(
        residuals=residuals,
        inside=[
            np.abs(r) <= Z90 * np.sqrt(np.diagonal(c)) for r, c in zip(residuals, covariances, strict=True)
        ],
        elpd=np.array(
            [log_densities(r, c, groups[held]) for r, c in zip(residuals, covariances, strict=True)]
        ),
        chosen=chosen,
    )


def _over_forms(
    problem: Problem, sizes: Sizes, index: tuple[NDArray[np.intp], NDArray[np.intp]]
) -> tuple[Array, Array]:
    """Mean (h,) and covariance (h, h) of the mixture of all forms that the fitted rows leave open.

    Forms that agree where they were fitted may be far apart where nothing was, as in a first cycle.
    """
    weights = np.where(sizes.weights >= OPEN, sizes.weights, 0.0)
    weights /= weights.sum()
    open_fits = [(w, f) for w, f in zip(weights, sizes.fits, strict=True) if w > 0.0]
    each = [(w, *predict_rows(problem, fitted, index)) for w, fitted in open_fits]
    mean = np.sum([w * m for w, m, _ in each], axis=0)
    return mean, np.sum([w * (c + np.outer(m - mean, m - mean)) for w, m, c in each], axis=0)
