"""Each pressure level predicted from all the others: what the bands are worth where no loop was recorded.

The posterior without a level is the whole one reweighted by one over what that level added to the
likelihood, its weights smoothed (Vehtari, Simpson, Gelman, Yao and Gabry 2024, Pareto smoothed importance
sampling, https://jmlr.org/papers/v25/19-556.html); where few draws would carry it, it is found anew from its
mode. Moduli and remainder are drawn from their exact distribution given the other levels in either case.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.arviz_import import import_arviz
from mpam_calib.model.readings import Readings
from mpam_calib.model.remainder import ROUGH
from mpam_calib.posterior.chains.weighing import laplace_mixture
from mpam_calib.posterior.density.batch import batch_size
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.mode import climb_modes, evaluate
from mpam_calib.posterior.density.target import predict_force, without_level
from mpam_calib.posterior.draws import Draws
from mpam_calib.posterior.likelihood.floor import pulling
from mpam_calib.posterior.likelihood.points import KINDS
from mpam_calib.posterior.likelihood.row_motion import row_readings
from mpam_calib.prediction.free_moduli import as_others_say
from mpam_calib.prediction.reading_noise import ReadingNoise
from mpam_calib.specimen.recording import Specimen
from mpam_calib.units import KPA

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

COLUMNS = ["pressure_kPa", "readings", "rmse_N", "bias_N", "bias_sd_N", "inside90", "extrapolated"]
FEWEST, MOST = 3, 8
"""Levels from which one can be left out, and of a test with loops, which cost the most, how many are."""
READINGS = 200
"""Readings of a level that are predicted."""
DRAWS, PROPOSED = 400, 2000
RELIABLE = 0.7
"""Pareto's k up to which reweighted draws are believed; S of them up to 1 − 1/log10 S (Vehtari et al.)."""


@dataclass(frozen=True)
class _Held:
    """Readings (n,) of one level, their forces (N), and of how many of the rig's each is the mean."""

    places: Readings
    force: Array
    averaged: Array


def levels_left_out(specimen: Specimen, target: Collapsed, draws: Draws, seed: int) -> pd.DataFrame:
    """A row of COLUMNS for each level, the lowest and the highest extrapolated.

    ``inside90``: share of the level's readings inside the 90 % band that all other levels give a new reading
    there; ``bias_N`` their mean above the prediction, ``bias_sd_N`` the sd that the prediction gives it, the
    readings' noise included. Moduli, or a friction, of the level's own are what predictions there take.
    Empty where there are fewer than FEWEST levels.
    """
    return pd.DataFrame(_rows(specimen, target, draws, seed), columns=COLUMNS)


def levels_looked_at(specimen: Specimen) -> Ints:
    """All levels where that is cheap; of a test with loops, whose rows are many, at most MOST of them."""
    count = len(specimen.levels_Pa)
    most = count if specimen.loops is None else MOST
    return np.unique(np.linspace(0, count - 1, most).round().astype(np.int64))


def _rows(specimen: Specimen, target: Collapsed, draws: Draws, seed: int) -> list[list[object]]:
    levels = specimen.levels_Pa
    if target.model.setting is None or len(levels) < FEWEST:
        return []
    thinned = draws.thin(DRAWS)
    whole = _likelihood(target, thinned)
    rows: list[list[object]] = []
    for level in levels_looked_at(specimen):
        held = _held(specimen, target, int(level))
        if held is None:
            continue
        fold = without_level(specimen, target, int(level))
        rng = np.random.default_rng([seed, 11, int(level)])
        u = _reweighted(fold, thinned, whole, rng)
        if u is None:
            continue
        force, seen = _predict(fold, int(level), u, held, rng)
        low, high = np.quantile(seen, [0.05, 0.95], axis=0)
        miss = held.force - force.mean(axis=0)
        rows.append(
            [
                round(float(levels[level]) / KPA, 3), len(miss), float(np.sqrt(np.mean(miss**2))),
                float(miss.mean()), float(seen.mean(axis=1).std()),
                float(np.mean((held.force >= low) & (held.force <= high))),
                bool(level in (0, len(levels) - 1)),
            ]
        )  # fmt: skip
    return rows


def _held(specimen: Specimen, target: Collapsed, level: int) -> _Held | None:
    """The level's readings that are not slack, evenly thinned; None without any."""
    places: list[Readings] = []
    force: list[Array] = []
    averaged: list[Array] = []
    if (loops := specimen.loops) is not None:
        index = np.flatnonzero(pulling(loops) & (loops.level == level))
        places.append(row_readings(loops).take(index))
        force.append(loops.force_N[index])
        averaged.append(np.full(len(index), float(loops.averaged)))
    if (points := target.data.points) is not None:
        kept = (points.level(specimen.levels_Pa) == level) & ~points.censored
        index = np.flatnonzero(kept & (points.kind != KINDS.index("free_contraction")))
        places.append(points.readings.take(index))
        force.append(points.force[index])
        averaged.append(np.ones(len(index)))
    everything, value = Readings.join(places), np.concatenate(force)
    if not len(value):
        return None
    some = np.unique(np.linspace(0, len(value) - 1, READINGS).round().astype(np.int64))
    return _Held(everything.take(some), value[some], np.concatenate(averaged)[some])


def _likelihood(target: Collapsed, draws: Draws) -> Array:
    """Log likelihood (N,) of the draws' sampled coordinates."""
    size = batch_size(target)
    parts = (draws.u[i : i + size] for i in range(0, len(draws), size))
    return np.concatenate([target.log_likelihood(target.model.values(u)) for u in parts])


def _reweighted(fold: Collapsed, draws: Draws, whole: Array, rng: np.random.Generator) -> Array | None:
    """Coordinates (N, d) drawn from the posterior without the level; None where none can be found."""
    ratio = _likelihood(fold, draws) - whole
    weight, shape = _smoothed(ratio)
    if shape <= min(RELIABLE, 1.0 - 1.0 / np.log10(len(draws))):
        return draws.u[rng.choice(len(draws), len(draws), p=weight)]
    start = draws.u[int(np.argmax(ratio))]
    mixture = laplace_mixture(climb_modes(fold, [start, draws.u.mean(axis=0)]))
    proposed = mixture.draw(PROPOSED, np.random.RandomState(int(rng.integers(2**31))))
    ratio = evaluate(fold, proposed) - mixture.log_density(proposed)
    if not np.isfinite(ratio).any():
        return None
    weight, _ = _smoothed(ratio)
    return proposed[rng.choice(PROPOSED, len(draws), p=weight)]


def _smoothed(ratio: Array) -> tuple[Array, float]:
    """Smoothed weights (N,), which add up to one, of draws with these log ratios, and Pareto's k."""
    weight, shape = import_arviz().psislw(np.where(np.isfinite(ratio), ratio, -np.inf))
    return np.exp(weight), float(shape)


def _predict(
    fold: Collapsed, level: int, u: Array, held: _Held, rng: np.random.Generator
) -> tuple[Array, Array]:
    """Force (N, n) at a level with all that the simulation may miss, and readings of it."""
    model, size = fold.model, batch_size(fold)
    assert model.setting is not None and model.chain is not None
    # Of friction or moduli of its own the other levels say nothing, whatever the draws know of them.
    values = model.chain.friction.as_others_say(model.values(u), level)
    eta = np.concatenate(
        [fold.linear_draws(model.values(u[i : i + size]), rng) for i in range(0, len(u), size)]
    )
    if (block := model.moduli) is not None and block.law.name == "free":
        p = block.size
        unknown = rng.standard_normal((len(u), 1 + len(block.law.levels)))
        eta = np.hstack([as_others_say(block, eta[:, :p], level, unknown), eta[:, p:]])
    force = predict_force(model, values, eta, held.places)
    if ROUGH in values:
        force = force + values[ROUGH] * rng.standard_normal(force.shape)
    noise = ReadingNoise(values, model.setting.force_scale, held.averaged)
    return force, force + noise.draw(force, rng)
