"""How a model predicts pressure levels that its fit has not seen."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.folds import FEWEST, Z90, folds_of, log_densities, total
from mpam_calib.criticism.fitting.predicted import predict_rows
from mpam_calib.criticism.selection.ranking import Ranked, blueprint_of
from mpam_calib.criticism.tasks.spread import held_problem
from mpam_calib.units import KPA

Array = NDArray[np.float64]

LEVEL_COLUMNS = ["pressure_kPa", "rows", "rmse_N", "bias_N", "bias_sd_N", "inside90", "extrapolated"]


def hold_out(ranked: Ranked) -> tuple[float, float, float]:
    """RMSE (N), joint log predictive density and its standard error, whole levels left out in folds.

    NaN where there are too few levels, or a fold cannot be fitted.
    """
    problem = held_problem()
    labels = np.unique(problem.level)
    blank = (float("nan"),) * 3
    if len(labels) < FEWEST:
        return blank
    squares, densities = [], []
    for part in folds_of(labels):
        try:
            residual, covariance = _left_out(problem, ranked, part)
            level = problem.level[np.isin(problem.level, part)]
            densities.append(log_densities(residual, covariance, level))
        except np.linalg.LinAlgError:
            return blank
        squares.append(residual**2)
    return float(np.sqrt(np.mean(np.concatenate(squares)))), *total(np.concatenate(densities))


def hold_out_each(ranked: Ranked) -> pd.DataFrame:
    """Each level predicted from all others, one row per level with LEVEL_COLUMNS; empty with too few.

    ``bias_N`` is the mean of reading less prediction, ``bias_sd_N`` what the prediction itself gives as its
    sd; ``inside90`` the share of reduced rows inside their 90 % band. The lowest and the highest level are
    extrapolated.
    """
    problem = held_problem()
    labels = np.unique(problem.level)
    rows: list[list[object]] = []
    for label in labels if len(labels) >= FEWEST else labels[:0]:
        try:
            residual, covariance = _left_out(problem, ranked, labels[labels == label])
        except np.linalg.LinAlgError:
            continue
        pressure = float(np.mean(problem.middle().pressure[problem.level == label])) / KPA
        rows.append(
            [
                pressure, len(residual), float(np.sqrt(np.mean(residual**2))), float(residual.mean()),
                float(np.sqrt(covariance.mean())),
                float(np.mean(np.abs(residual) <= Z90 * np.sqrt(np.diagonal(covariance)))),
                bool(label in (labels[0], labels[-1])),
            ]
        )  # fmt: skip
    return pd.DataFrame(rows, columns=LEVEL_COLUMNS)


def _left_out(problem: Problem, ranked: Ranked, levels: NDArray[np.int64]) -> tuple[Array, Array]:
    """Residual (h,) and predictive covariance (h, h) of these levels' rows, fitted to all others.

    The remainder has the size that suits the model best on all rows.
    """
    held = np.isin(problem.level, levels)
    best = ranked.best
    blueprint = blueprint_of(problem, ranked.simulation)
    found = fit(problem.take(~held), frozenset(), best.size, best.ended, blueprint)
    mean, covariance = predict_rows(problem, found, (np.flatnonzero(~held), np.flatnonzero(held)), blueprint)
    return problem.force[held] - mean, covariance
