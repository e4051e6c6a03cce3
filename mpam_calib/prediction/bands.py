"""Credible bands as the tables ``bands.csv`` and ``predictions.csv``."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.tensile import MISFIT, NOISE
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.curves import (
    BRANCHES,
    Curves,
    Reach,
    contraction_grid,
    first_root,
    force_curves,
    past,
    pressure_rng,
)
from mpam_calib.prediction.recorded import Recorded
from mpam_calib.units import KPA

Array = NDArray[np.float64]

COLUMNS = [
    "quantity",
    "pressure_kPa",
    "contraction",
    "branch",
    "mean",
    "q05",
    "q25",
    "q50",
    "q75",
    "q95",
    "extrapolated",
]
DRAWS = 2000
QUANTILES = [0.05, 0.25, 0.5, 0.75, 0.95]
STRESS_POINTS = 101
REACH_DRAWS = 200
"""Draws behind a mean free contraction that only says how far readings reach."""
ROOTLESS = 0.05
"""Share of curves without a root above which a free contraction is marked extrapolated."""


def muscle_bands(
    model: Model,
    draws: Draws,
    pressures: Array,
    seed: int,
    trim: bool = True,
    recorded: Recorded | None = None,
) -> pd.DataFrame:
    """Bands on force, blocked force and free contraction at pressures (Pa), each also ``_observed``.

    Curves end at the first grid point at or beyond the mean free contraction (``trim``). A pressure's bands
    are the same whichever others are asked for. Without ``recorded`` both branches are taken for recorded.
    A slack reading beyond a free contraction tells of it: the muscle has come to no force before. Of the
    force it tells but a bound: that is marked extrapolated from the last reading that pulls on.
    """
    reach = Reach.of(model.blueprint)
    grid = contraction_grid(model, float(reach.contraction.max()))
    curves = force_curves(model, draws.thin(DRAWS), pressures, grid, seed)
    noise = [_Noise.draw(curves, j, pressure_rng(seed, 5, P)) for j, P in enumerate(pressures)]
    free = first_root(grid, curves.force[:, :, 2])
    outside = reach.outside(pressures)
    furthest = _furthest(reach, model, draws, pressures, free, grid, seed)
    slack = furthest
    if np.any(reach.slack > reach.contraction):
        slack = _furthest(replace(reach, contraction=reach.slack), model, draws, pressures, free, grid, seed)
    unseen = past(furthest[:, None], grid) | reach.before(pressures[:, None], grid) | outside[:, None]
    parts = []
    for observed in (False, True):
        curve = np.stack([each.curve for each in noise], axis=1) if observed else None
        suffix = "_observed" if observed else ""
        for j, branch in enumerate(BRANCHES):
            force = curves.force[:, :, j]
            if curve is not None:
                # The same noise at each branch's own force, with which it may grow.
                force = force + curve * curves.noise.growth(force)
            table = _table(f"force_N{suffix}", pressures, grid, branch, force)
            told = recorded is None or recorded.tells(branch, model)
            table["extrapolated"] = unseen.ravel() if told else True
            if trim:
                end = np.searchsorted(grid, free.mean(axis=0) - 1e-12)
                table = table[(np.arange(len(grid))[None, :] <= end[:, None]).ravel()]
            parts.append(table)
        blocked, contraction = curves.force[:, :, 2, 0], free
        if observed:
            blocked = blocked + np.stack([each.blocked for each in noise], axis=1)
            # The cell's noise moves the point where the force is read as zero.
            shifted = curves.force[:, :, 2] + np.stack([each.zero for each in noise], axis=1)
            own = np.stack([each.contraction for each in noise], axis=1)
            contraction = np.maximum(first_root(grid, shifted) + own, 0.0)
        table = _table(f"blocked_force_N{suffix}", pressures, np.zeros(1), "", blocked[:, :, None])
        # Blocked forces may have been read at more pressures than the loops.
        read = np.zeros(len(pressures), dtype=bool) if recorded is None else recorded.blocked(pressures)
        parts.append(table.assign(extrapolated=unseen[:, 0] & ~read))
        table = _table(f"free_contraction{suffix}", pressures, np.zeros(1), "", contraction[:, :, None])
        rootless = np.isnan(_mean_free(free, grid))
        table["extrapolated"] = outside | rootless | past(slack, free.mean(axis=0))
        parts.append(table.assign(contraction=np.nan))
    return pd.concat(parts, ignore_index=True)[COLUMNS]


def _furthest(
    reach: Reach, model: Model, draws: Draws, pressures: Array, free: Array, grid: Array, seed: int
) -> Array:
    """Largest contraction (pressures,) that readings reach; ``free`` (N, pressures) as predicted there."""
    inside = reach.inside(pressures)
    if not inside.any():
        return reach.at(pressures)
    levels = np.unique(np.concatenate(reach.neighbours(pressures[inside])))
    curves = force_curves(model, draws.thin(REACH_DRAWS), reach.pressures[levels], grid, seed)
    at_levels = np.full(len(reach.pressures), np.nan)
    at_levels[levels] = _mean_free(first_root(grid, curves.force[:, :, 2]), grid)
    return reach.along(pressures, _mean_free(free, grid), at_levels)


def _mean_free(free: Array, grid: Array) -> Array:
    """Mean free contraction (pressures,), nan where there is none.

    A curve that never reaches zero ends at the grid's edge: that is no free contraction.
    """
    rootless = np.mean(free >= grid[-1], axis=0) > ROOTLESS
    return np.where(rootless, np.nan, free.mean(axis=0))


@dataclass(frozen=True)
class _Noise:
    """What new readings at one pressure add to N draws.

    Along a curve without force (N, γ), to a blocked force (N,) and where the force is zero (N, 1), all in
    newtons; and to a free contraction (N,).
    """

    curve: Array
    blocked: Array
    zero: Array
    contraction: Array

    @classmethod
    def draw(cls, curves: Curves, j: int, rng: np.random.Generator) -> _Noise:
        """For the j-th pressure of the curves."""
        force = curves.force[:, j, 2]
        noise, zero = curves.noise, np.zeros((len(force), 1))
        return cls(
            noise.unloaded(force.shape, rng), noise.draw(force[:, 0], rng), noise.draw(zero, rng),
            curves.contraction_noise * rng.standard_normal(len(force)),
        )  # fmt: skip


def stress_bands(model: Model, draws: Draws, seed: int) -> pd.DataFrame:
    """Bands on engineering stress (Pa) over the declared strain range (in the column ``contraction``)."""
    assert model.tensile is not None
    strain = np.linspace(model.tensile.low, model.tensile.high, STRESS_POINTS)
    thinned = draws.thin(DRAWS)
    stress = stress_draws(model, thinned, strain)
    rng = np.random.default_rng([seed, 6])
    noisy = stress + thinned.values[NOISE] * rng.standard_normal(stress.shape)
    parts = [
        _table(name, np.zeros(1), strain, "", values[:, None, :])
        for name, values in (("stress_Pa", stress), ("stress_Pa_observed", noisy))
    ]
    table = pd.concat(parts, ignore_index=True)
    low, high = model.blueprint.tensile_tested or (-np.inf, np.inf)
    beyond = (table["contraction"] < low - 1e-9) | (table["contraction"] > high + 1e-9)
    return table.assign(extrapolated=beyond)[COLUMNS]


def stress_draws(model: Model, draws: Draws, strain: Array, remainder: bool = True) -> Array:
    """Stress (N, n), Pa, at strains (n,)."""
    assert model.tensile is not None and model.moduli is not None
    p, q, _ = model.linear_sizes
    moduli = model.moduli.coefficients(draws.eta[:, :p], draws.values)
    stress: Array = moduli @ model.tensile.powers(strain).T
    if remainder and MISFIT in draws.values:
        stress = stress + draws.values[MISFIT] * (draws.eta[:, p + q :] @ model.tensile.remainder(strain).T)
    return stress


def _table(quantity: str, pressures: Array, contractions: Array, branch: str, draws: Array) -> pd.DataFrame:
    """Rows (pressure major) of draws (N, pressures, contractions)."""
    flat = draws.reshape(len(draws), -1)
    quantiles = np.quantile(flat, QUANTILES, axis=0)
    pressure, contraction = np.meshgrid(pressures / KPA, contractions, indexing="ij")
    return pd.DataFrame(
        {
            "quantity": quantity,
            # A level is a median of readings: a thousandth of a kPa is all it means.
            "pressure_kPa": np.round(pressure.ravel(), 3),
            "contraction": np.round(contraction.ravel(), 9),
            "branch": branch,
            "mean": flat.mean(axis=0),
            **{f"q{round(100 * q):02d}": values for q, values in zip(QUANTILES, quantiles, strict=True)},
        }
    )
