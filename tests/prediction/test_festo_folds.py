"""The measured Festo maps at pressure levels left out, beside a polynomial fitted to the same folds."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.noise import WHITE
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.chains.sampling import sample
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.posterior.draws import keep_draws
from mpam_calib.specimen import read
from mpam_calib.specimen.recording import Specimen

Array = NDArray[np.float64]
DATASETS = Path(__file__).parents[2] / "datasets"
FOLDS = 5
Z90 = 1.6449


def polynomial(P: Array, g: Array, F: Array, train: Array, test: Array) -> tuple[Array, Array]:
    """Cubic in contraction with pressure-linear coefficients: mean and sd of a new reading."""

    def columns(rows: Array) -> Array:
        return np.stack([g[rows] ** k * p for k in range(4) for p in (np.ones(rows.sum()), P[rows] / 1e5)], 1)

    X, new = columns(train), columns(test)
    coefficients = np.linalg.lstsq(X, F[train], rcond=None)[0]
    residual = F[train] - X @ coefficients
    variance = residual @ residual / (train.sum() - X.shape[1])
    leverage = np.einsum("ij,jk,ik->i", new, np.linalg.inv(X.T @ X), new)
    return new @ coefficients, np.sqrt(variance * (1.0 + leverage))


def physics(specimen: Specimen, keep: Array, test: Array, seed: int) -> tuple[Array, Array, Array]:
    """Mean and 90 % band of the held-out readings from the posterior on the kept rows."""
    grid = specimen.force_map
    assert grid is not None and specimen.geometry is not None
    names = ("pressure_Pa", "contraction", "force_N", "level", "branch", "censored")
    fold = replace(specimen, force_map=replace(grid, **{n: getattr(grid, n)[keep] for n in names}))
    target, modes = locate(build_target(fold, draw_blueprint(specimen)), np.random.default_rng([seed, 0]))
    sampling = sample(target, modes, seed)
    assert sampling.converged
    draws = keep_draws(target, sampling, seed)
    readings = Readings.at_rest(grid.pressure_Pa[test], grid.contraction[test] * specimen.geometry.L0)
    force = predict_force(target.model, draws.values, draws.eta, readings)
    noisy = force + draws.values[WHITE] * np.random.default_rng(seed).standard_normal(force.shape)
    low, high = np.quantile(noisy, [0.05, 0.95], axis=0)
    return force.mean(axis=0), low, high


def interval_score(y: Array, low: Array, high: Array) -> float:
    """Gneiting and Raftery's score of 90 % intervals (lower is better)."""
    miss = np.maximum(low - y, 0.0) + np.maximum(y - high, 0.0)
    return float(np.mean(high - low + 2.0 / 0.1 * miss))


@pytest.mark.long
def test_levels_left_out_of_the_festo_maps(capsys: pytest.CaptureFixture[str]) -> None:
    covered: list[Array] = []
    for name in ("festo_dmsp10", "festo_dmsp20"):
        specimen = read(DATASETS / name)
        grid = specimen.force_map
        assert grid is not None
        rows: dict[str, list[Array]] = {"physics": [], "polynomial": []}
        for i in range(FOLDS):
            held = np.isin(grid.level, np.arange(len(specimen.levels_Pa))[i::FOLDS])
            test, seen = held & ~grid.censored, ~held & ~grid.censored
            y = grid.force_N[test]
            mean, sd = polynomial(grid.pressure_Pa, grid.contraction, grid.force_N, seen, test)
            rows["polynomial"].append(np.stack([y, mean, mean - Z90 * sd, mean + Z90 * sd]))
            rows["physics"].append(np.stack([y, *physics(specimen, ~held, test, seed=i)]))
        scores = {}
        for who, parts in rows.items():
            y, mean, low, high = np.concatenate(parts, axis=1)
            scores[who] = (float(np.sqrt(np.mean((y - mean) ** 2))), interval_score(y, low, high))
            if who == "physics":
                covered.append((y >= low) & (y <= high))
        with capsys.disabled():
            print(f"\n{name}: RMSE, interval score {scores}, coverage {covered[-1].mean():.3f}")
        assert scores["physics"][0] <= scores["polynomial"][0]
        assert scores["physics"][1] <= scores["polynomial"][1]
    assert 0.85 <= np.concatenate(covered).mean() <= 0.97
