"""The posterior of :mod:`benchmarks.problem` as users of PyMC and nutpie write it."""

from __future__ import annotations

import os
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .rows import Rows
from .stopwatch import Drawn, Stopwatch

Array = NDArray[np.float64]

CHAINS = 4


def build(rows: Rows, reduced: bool) -> Any:
    """The model: all rows in PyTensor's arrays, or their sufficient statistics."""
    import pymc as pm
    import pytensor.tensor as pt

    with pm.Model() as model:
        K = pm.HalfNormal("K_f", rows.friction_scale)
        # A truncated normal, as the image of a normal: its bound bends no sampler's path.
        below = stats.norm.cdf(rows.pulls_at / rows.dead_band_sd)
        half = pt.erfinv(below * (1.0 + pt.erf(pm.Normal("dead") / np.sqrt(2.0))) - 1.0)
        dead = np.sqrt(2.0) * half
        noise = pm.LogNormal("noise", np.log(rows.noise_prior[0]), rows.noise_prior[1])
        xi = pm.Flat("xi", shape=8)
        band = dead * rows.dead_band_sd
        eta = rows.centre + rows.shift * band + rows.root @ xi
        pm.Potential("prior_of_eta", -0.5 * pt.sum(eta**2))
        pm.Deterministic("figures", pt.concatenate([rows.transform @ eta, pt.stack([band / 1e3, K, noise])]))
        # Everything that is linear in one product: (1, P_DB, ξ) and their columns about the centre.
        v = pt.concatenate([pt.stack([1.0, dead]), xi])
        Z = _columns(rows)
        if reduced:
            pm.Potential("likelihood", _reduced_likelihood(rows, Z, K, v, noise))
        else:
            pm.Normal("force", (1.0 + K * rows.sign) * (Z @ v), noise, observed=rows.force)
    return model


def _columns(rows: Rows) -> Array:
    """Force at the centre, per prior sd of P_DB and per ξ: (n, 10)."""
    g, X = rows.per_pressure, rows.columns
    base = rows.pressure * g + X @ rows.centre
    return np.column_stack([base, rows.dead_band_sd * (X @ rows.shift - g), X @ rows.root])


def _reduced_likelihood(rows: Rows, Z: Array, K: Any, v: Any, noise: Any) -> Any:
    """Residual sum of squares of each branch, a quadratic form in v."""
    import pytensor.tensor as pt

    total = 0.0
    for sign in (-1.0, 1.0):
        own = rows.sign == sign
        slope, y, Zs = 1.0 + K * sign, rows.force[own], Z[own]
        total = total + y @ y - 2.0 * slope * pt.dot(v, Zs.T @ y) + slope**2 * pt.dot(v, pt.dot(Zs.T @ Zs, v))
    return -len(rows.force) * pt.log(noise) - 0.5 * total / noise**2


def draw(library: str, rows: Rows, reduced: bool, draws: int, seed: int = 1) -> Drawn:
    """Sample; the time that counts as sampling is the draws' share of all leapfrog steps."""
    model = build(rows, reduced)
    cores = os.cpu_count() or 1
    if library == "nutpie":
        import nutpie

        compiled = nutpie.compile_pymc_model(model)
        watch = Stopwatch()
        trace = nutpie.sample(
            compiled, draws=draws, chains=CHAINS, cores=cores, seed=seed, progress_bar=False
        )
    else:
        import pymc as pm

        watch = Stopwatch()
        trace = pm.sample(
            draws=draws,
            chains=CHAINS,
            cores=cores,
            random_seed=seed,
            progressbar=False,
            compute_convergence_checks=False,
            discard_tuned_samples=False,
            model=model,
        )
    wall, cpu = watch.read()
    steps = float(trace.sample_stats["n_steps"].sum())
    share = steps / (steps + float(trace.warmup_sample_stats["n_steps"].sum()))
    figures = trace.posterior["figures"].to_numpy()
    return Drawn(figures[:, :, None, :], share * wall, share * cpu)
