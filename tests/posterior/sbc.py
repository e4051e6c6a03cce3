"""Simulation-based calibration: draw the truth from the prior, the data from the model, rank the truth.

If the posterior is right, the truth's rank among its draws is uniform, for every quantity. The ranks'
ECDF must stay inside a band that holds simultaneously along the ECDF and over all quantities at once.
"""

from __future__ import annotations

from functools import lru_cache, partial
from multiprocessing import get_context

import numpy as np
from model import build
from scipy import stats
from threadpoolctl import threadpool_limits

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.model.noise import CORRELATED
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.chains.sampling import sample
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.posterior.draws import Draws, reported
from mpam_calib.specimen.recording import Specimen

Array = np.ndarray
L = 99
"""Draws that the truth is ranked among."""
PREDICTED = Readings.at_rest(np.array([1.25e5, 1.8e5]), np.array([0.004, 0.009]), np.array([1.0, -1.0]))
"""Two forces away from the data: between levels, on either branch."""


def design(declared: dict, options: Options, rows: int = 12, dt: float = 0.1):
    """A specimen of three loops with the forces still to come, and its blueprint."""
    made = build.specimen(declared, build.loops((100.0, 150.0, 200.0), 12.0, rows, dt=dt))
    made = build.with_force(made, np.full(6 * rows, 20.0))
    return made, draw_blueprint(made, options)


def simulate(made: Specimen, blueprint, rng: np.random.Generator):
    """Truth (u, η) from the prior and the specimen with its data."""
    model = build_target(made, blueprint).model
    u = rng.standard_normal((1, len(model.names)))
    eta = rng.standard_normal((1, sum(model.linear_sizes)))
    values = model.values(u)
    assert made.loops is not None
    force = predict_force(model, values, eta, build.rows_of(made.loops))[0]
    n = len(force)
    noise = values["noise_sd_N"][0, 0] * rng.standard_normal(n)
    if "noise_corr_sd_N" in values:
        tau = values["noise_corr_time_s"][0, 0]
        for stroke in np.unique(made.loops.stroke):
            rows = np.flatnonzero(made.loops.stroke == stroke)
            time = made.loops.time_s[rows]
            cov = np.exp(-np.abs(time[:, None] - time) / tau)
            root = np.linalg.cholesky(cov + 1e-12 * np.eye(len(rows)))
            noise[rows] += values["noise_corr_sd_N"][0, 0] * root @ rng.standard_normal(len(rows))
    return u, eta, build.with_force(made, force + noise)


def quantities(target: Collapsed, made: Specimen, u: Array, eta: Array) -> tuple[list[str], Array]:
    """Everything reported, the joint log-likelihood and two predicted forces: (draws, quantities)."""
    model = target.model
    values = model.values(u)
    listed = reported(model, Draws(u, values, eta, 1))
    force = predict_force(model, values, eta, PREDICTED)
    likelihood = (of_bins if CORRELATED in values else of_rows)(target, made, values, eta)
    columns = [*(item.draws for item in listed), likelihood, force[:, 0], force[:, 1]]
    names = [*(item.name for item in listed), "log-likelihood", "force, loading", "force, unloading"]
    return names, np.stack(columns, axis=1)


def of_rows(target: Collapsed, made: Specimen, values: dict[str, Array], eta: Array) -> Array:
    """ln p(y | u, η) of the rows (draws,) under white noise, of which bins lose nothing."""
    assert made.loops is not None
    residual = made.loops.force_N - predict_force(target.model, values, eta, build.rows_of(made.loops))
    sd = values["noise_sd_N"]
    return stats.norm.logpdf(residual, scale=sd).sum(axis=1)


def of_bins(target: Collapsed, made: Specimen, values: dict[str, Array], eta: Array) -> Array:
    """The same of bins and their scatter, which is what a posterior of correlated noise is given.

    Bayes' rule: ln p(y | u, η) = ln p(y | u) + ln p(η | u, y) − ln p(η). Rows know more of the noise than
    bins do, so that their likelihood would rank the truth too high.
    """
    value, centre, factor = target._solve(values)
    z = np.einsum("bkl,bk->bl", factor, eta) - centre
    log_det = np.log(np.diagonal(factor, axis1=1, axis2=2)).sum(axis=1)
    return value + log_det - 0.5 * np.sum(z**2, axis=1) + 0.5 * np.sum(eta**2, axis=1)


def replicate(
    declared: dict, options: Options, seed: int, factors: tuple[float, ...], **shape: float
) -> tuple[list[str], Array]:
    """Ranks (factors, quantities) of one truth among draws that were narrowed by each factor."""
    rng = np.random.default_rng([seed, 99])
    made, blueprint = design(declared, options, **shape)
    u, eta, made = simulate(made, blueprint, rng)
    target, modes = locate(build_target(made, blueprint), np.random.default_rng([seed, 0]))
    chain = sample(target, modes, seed, max_steps=800).chain
    flat = chain.reshape(-1, chain.shape[-1])
    drawn_u = flat[rng.permutation(len(flat))[: 10 * L]]
    values = target.model.values(drawn_u)
    drawn_eta = np.concatenate(
        [
            target.linear_draws({k: v[i : i + 50] for k, v in values.items()}, rng)
            for i in range(0, 10 * L, 50)
        ]
    )
    names, truth = quantities(target, made, u, eta)
    _, draws = quantities(target, made, drawn_u[:L], drawn_eta[:L])
    # The joint distance in normal coordinates: what narrows or shifts all parameters together shows here.
    joint = np.concatenate([drawn_u, drawn_eta], axis=1)
    true_joint = np.concatenate([u, eta], axis=1)
    ranks = []
    for factor in factors:
        centre, spread = joint[L:].mean(axis=0), np.cov(joint[L:].T)
        precision = np.linalg.inv(spread)
        near, distance = narrowed(joint[:L], centre, factor), []
        for x in (near, true_joint):
            distance.append(np.einsum("ni,ij,nj->n", x - centre, precision, x - centre))
        below = (narrowed(draws, np.median(draws, axis=0), factor) < truth).sum(axis=0)
        ranks.append([*below, int((distance[0] < distance[1]).sum())])
    return [*names, "joint distance"], np.array(ranks)


def narrowed(draws: Array, centre: Array, factor: float) -> Array:
    """Draws towards a centre; as they are for a factor of one (w spans decades, where digits would go)."""
    return draws if factor == 1.0 else centre + factor * (draws - centre)


@lru_cache
def critical(replicates: int, level: float, simulations: int = 40_000) -> float:
    """Smallest pointwise p-value along an ECDF of uniform ranks that a share ``level`` falls below."""
    rng = np.random.default_rng(0)
    lowest = [smallest_p(rng.integers(0, L + 1, replicates), replicates) for _ in range(simulations)]
    return float(np.quantile(lowest, level))


@lru_cache
def _table(replicates: int) -> Array:
    """Two-sided binomial p-value of each count at each cut: (L, replicates + 1)."""
    counts = np.arange(replicates + 1)
    shares = np.arange(1, L + 1)[:, None] / (L + 1)
    below = stats.binom.cdf(counts, replicates, shares)
    above = stats.binom.sf(counts - 1, replicates, shares)
    return np.minimum(1.0, 2.0 * np.minimum(below, above))


def smallest_p(ranks: Array, replicates: int) -> float:
    """The least likely point of the ranks' ECDF."""
    cumulated = np.cumsum(np.bincount(ranks, minlength=L + 1))[:L]
    return float(_table(replicates)[np.arange(L), cumulated].min())


def outside(names: list[str], ranks: Array, level: float = 0.01) -> dict[str, float]:
    """Quantities whose ECDF leaves the band at a family-wise level, with their smallest p-values."""
    n = len(ranks)
    limit = critical(n, level / len(names))
    found = {name: smallest_p(ranks[:, i], n) for i, name in enumerate(names)}
    return {name: p for name, p in found.items() if p < limit}


def run(declared: dict, options: Options, replicates: int, **shape: float) -> tuple[list[str], Array, Array]:
    """Ranks as they are and of a posterior narrowed by 20 %.

    Two processes share the replicates; each has its own seed, so that it does not matter which does what.
    """
    one = partial(_narrowed_by_a_fifth, declared, options, shape)
    with get_context("fork").Pool(2, initializer=threadpool_limits, initargs=(1,)) as pool:
        found = pool.map(one, range(replicates), chunksize=1)
    names = found[0][0]
    ranks = np.stack([each for _, each in found])
    return names, ranks[:, 0], ranks[:, 1]


def _narrowed_by_a_fifth(
    declared: dict, options: Options, shape: dict[str, float], seed: int
) -> tuple[list[str], Array]:
    return replicate(declared, options, seed, (1.0, 0.8), **shape)
