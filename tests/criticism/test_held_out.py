"""Levels left out and predicted from the others: the figures of ``select``'s tables, by their definition."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.fitting.folds import folds_of
from mpam_calib.criticism.fitting.predicted import predict_rows
from mpam_calib.criticism.selection import held_out
from mpam_calib.criticism.selection.ranking import Ranked
from mpam_calib.specimen.declaration import Simulation

Predicted = tuple[np.ndarray, np.ndarray]


@pytest.fixture(scope="module")
def ranked(problem: Problem) -> Ranked:
    return Ranked(problem.blueprint.simulation, [fit(problem, frozenset(), 1)], 0.0)


def told(problem: Problem, ranked: Ranked, patch: pytest.MonkeyPatch) -> pd.DataFrame:
    patch.setattr(held_out, "held_problem", lambda: problem)
    return held_out.hold_out_each(ranked)


def left_out(problem: Problem, ranked: Ranked, levels: np.ndarray) -> Predicted:
    """Reading less prediction (N) of these levels' rows, and the prediction's covariance."""
    held = np.isin(problem.level, levels)
    best = ranked.best
    found = fit(problem.take(~held), frozenset(), best.size, best.ended)
    mean, covariance = predict_rows(problem, found, (np.flatnonzero(~held), np.flatnonzero(held)))
    return problem.force[held] - mean, covariance


def test_each_level_s_row_is_that_of_its_own_residuals(
    problem: Problem, ranked: Ranked, monkeypatch: pytest.MonkeyPatch
) -> None:
    table = told(problem, ranked, monkeypatch)
    labels = np.unique(problem.level)
    assert list(table.columns) == held_out.LEVEL_COLUMNS
    assert table["rows"].tolist() == [int(np.sum(problem.level == label)) for label in labels]
    levels = np.array(problem.blueprint.levels)[labels] / 1e3
    assert table["pressure_kPa"].to_numpy() == pytest.approx(levels, rel=0.01)
    assert table["extrapolated"].tolist() == [True, *[False] * (len(labels) - 2), True]
    for row, label in ((table.iloc[0], labels[0]), (table.iloc[1], labels[1])):
        residual, covariance = left_out(problem, ranked, np.array([label]))
        one = np.ones(len(residual)) / len(residual)
        assert row["rmse_N"] == pytest.approx(np.sqrt(np.sum(residual**2) / len(residual)))
        assert row["bias_N"] == pytest.approx(one @ residual)
        assert row["bias_sd_N"] == pytest.approx(np.sqrt(one @ covariance @ one))
        inside = np.abs(residual) < stats.norm.ppf(0.95) * np.sqrt(np.diagonal(covariance))
        assert row["inside90"] == pytest.approx(inside.mean())


def test_a_level_that_reads_too_much_has_a_bias_above_zero_and_lies_outside(
    problem: Problem, ranked: Ranked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And the prediction from the others is not moved by it."""
    plain = told(problem, ranked, monkeypatch)
    more = 20.0 * problem.noise_level.total
    raised = problem.with_force(problem.force + more * (problem.level == np.unique(problem.level)[1]))
    moved = told(raised, ranked, monkeypatch)
    assert moved["bias_N"][1] - plain["bias_N"][1] == pytest.approx(more, rel=1e-6)
    assert moved["bias_N"][1] > 10.0 * moved["bias_sd_N"][1]
    assert (plain["inside90"][1], moved["inside90"][1]) == (pytest.approx(0.9, abs=0.1), 0.0)


def test_all_levels_together_are_the_folds_residuals(
    problem: Problem, ranked: Ranked, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(held_out, "held_problem", lambda: problem)
    rmse, density, error = held_out.hold_out(ranked)
    folds = [left_out(problem, ranked, part) for part in folds_of(np.unique(problem.level))]
    squares = np.concatenate([residual**2 for residual, _ in folds])
    assert rmse == pytest.approx(np.sqrt(squares.mean()))
    joint = sum(stats.multivariate_normal(cov=covariance).logpdf(residual) for residual, covariance in folds)
    assert density == pytest.approx(joint) and error > 0.0


def test_too_few_levels_have_no_figures(
    problem: Problem, ranked: Ranked, monkeypatch: pytest.MonkeyPatch
) -> None:
    two = problem.take(np.isin(problem.level, np.unique(problem.level)[:2]))
    assert told(two, ranked, monkeypatch).empty
    assert np.isnan(held_out.hold_out(ranked)).all()


def test_the_remainder_s_likeliest_size_is_taken(ranked: Ranked) -> None:
    (one,) = ranked.fits
    worse = replace(one, log_evidence=one.log_evidence - 50.0, size=0)
    assert Ranked(Simulation(friction="none"), [worse, one], 0.0).best is one
