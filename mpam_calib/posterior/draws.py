"""Kept posterior draws: sampled values, the linear coordinates drawn back, the thesis's coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.moduli import ModuliBlock
from mpam_calib.posterior.chains.sampling import Sampling
from mpam_calib.posterior.density.batch import batch_size
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.pool import held_target, workers
from mpam_calib.units import KPA, si_factor

Array = NDArray[np.float64]

KEPT = 1000
"""Draws kept of each ensemble."""
PRIOR = 2000
"""Draws of the prior that its widths are told by."""


def kept_for(ess_wanted: float) -> int:
    """Draws to keep of each of four ensembles: KEPT, or twice the share of effective draws that is wanted."""
    return max(KEPT, int(np.ceil(0.5 * ess_wanted)))


@dataclass(frozen=True)
class Draws:
    """N draws, ensemble by ensemble: ``u`` (N, d) coordinates, ``values`` name → (N, 1) SI, ``eta`` (N, k).

    ``chains`` is the number of ensembles; N is a multiple of it. ``index`` (N / chains,), or (chains,
    N / chains) where that differs, tells which of each ensemble's draws they are, where they are of sampling.
    """

    u: Array
    values: dict[str, Array]
    eta: Array
    chains: int
    index: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return len(self.u)

    def thin(self, count: int) -> Draws:
        """At most ``count`` draws, evenly spaced."""
        if count >= len(self):
            return self
        return self.take(np.linspace(0, len(self) - 1, count).astype(np.int64))

    def take(self, keep: NDArray[np.int64]) -> Draws:
        """The draws at some places, as if of one ensemble."""
        return Draws(self.u[keep], {k: v[keep] for k, v in self.values.items()}, self.eta[keep], 1)


def spread_over(steps: int, walkers: int, kept: int) -> NDArray[np.int64]:
    """Which of an ensemble's draws (steps × walkers, step by step) are kept, at most as many as there are.

    The walkers take turns while the steps go on evenly, so that each is seen as far apart in time as can be.
    Evenly spaced draws could be those of a few walkers, and remember for as long as these do.
    """
    count = min(kept, steps * walkers)
    turn = np.arange(count)
    return turn * steps // count * walkers + turn % walkers


def keep_draws(target: Collapsed, sampling: Sampling, seed: int, kept: int | None = KEPT) -> Draws:
    """Draws of every ensemble (None: all), with η drawn from its exact conditional for each."""
    E, T, W, d = sampling.chain.shape
    keep = spread_over(T, W, kept or T * W)
    u = sampling.chain.reshape(E, T * W, d)[:, keep].reshape(-1, d)
    size = batch_size(target)
    tasks = [(u[i : i + size], [seed, 1, i]) for i in range(0, len(u), size)]
    with workers(target, E) as pool:
        eta = np.concatenate(pool.map(_draw_back, tasks))
    return Draws(u, target.model.values(u), eta, E, keep)


def _draw_back(task: tuple[Array, list[int]]) -> Array:
    """η for coordinates u (in a worker)."""
    u, seeds = task
    target = held_target()
    return target.linear_draws(target.model.values(u), np.random.default_rng(seeds))


@dataclass(frozen=True)
class Reported:
    """A quantity as it is printed: its name, unit, draws (N,) in that unit, and its prior's sd.

    ``meaning`` says what it is, in a few words for a rig engineer.
    """

    name: str
    unit: str
    draws: Array
    prior_sd: float
    sampled: bool
    meaning: str


def reported(model: Model, draws: Draws, seed: int = 0) -> list[Reported]:
    """Everything ``summary.csv`` lists, in lab units: coefficients of the law first."""
    found = _coefficients(model, draws, seed)
    for parameter in model.parameters:
        if parameter in model.coordinates_sampled:
            continue
        name = parameter.name
        level = name.partition("@")[2]
        factor = si_factor(name)
        if name.split("_")[0] in ("d", "gap") and parameter.unit == "1/kPa":
            found.append(_rate(model, draws, name))
            continue
        found.append(
            Reported(
                name,
                parameter.printed_unit,
                draws.values[name][:, 0] / factor,
                parameter.prior.sd / factor,
                True,
                parameter.meaning + (f", at {level} kPa" if level else ""),
            )
        )
    return found


def _coefficients(model: Model, draws: Draws, seed: int) -> list[Reported]:
    if model.moduli is None:
        return []
    p = model.linear_sizes[0]
    law = model.moduli.law
    posterior = model.moduli.coefficients(draws.eta[:, :p], draws.values)
    prior = _coefficient_sds(model, model.moduli, seed)
    return [
        Reported(name, unit, posterior[:, i] / factor, float(prior[i] / factor), False, meaning)
        for i, (name, (unit, factor), meaning) in enumerate(
            zip(law.coefficient_names(), law.coefficient_units(), law.coefficient_meanings(), strict=True)
        )
    ]


def _coefficient_sds(model: Model, moduli: ModuliBlock, seed: int) -> Array:
    """Prior sds (q,) of the law's coefficients, SI: exact but where they depend on rates that are sampled."""
    u, eta = _prior(model, seed)
    if moduli.fixed:
        _, transform = moduli.transform(model.values(u[:1]))
        return np.asarray(np.sqrt(np.sum(transform[0] ** 2, axis=-1)))
    return np.asarray(moduli.coefficients(eta, model.values(u)).std(axis=0))


def _rate(model: Model, draws: Draws, name: str) -> Reported:
    """d as it is; in place of the gap, z = d − gap (thesis Eq. 4.8), both in 1/kPa."""
    stem, _, order = name.partition("_")
    whose = f"modulus E_{order}" if order else "the law"
    sd = {parameter.name: parameter.prior.sd * KPA for parameter in model.parameters}
    rate = draws.values[name][:, 0] * KPA
    if stem == "d":
        return Reported(name, "1/kPa", rate, sd[name], True, f"faster rate of {whose}")
    other, printed = (f"d_{order}", f"z_{order}") if order else ("d", "z")
    rate = draws.values[other][:, 0] * KPA - rate
    return Reported(
        printed, "1/kPa", rate, float(np.hypot(sd[other], sd[name])), False, f"slower rate of {whose}"
    )


def _prior(model: Model, seed: int) -> tuple[Array, Array]:
    """PRIOR draws of the prior: u (PRIOR, d) and the moduli's coordinates (PRIOR, p)."""
    rng = np.random.default_rng([seed, 2])
    u = rng.standard_normal((PRIOR, len(model.names)))
    eta = rng.standard_normal((PRIOR, model.linear_sizes[0]))
    sampled = model.moduli_of(model.values(u))
    return u, eta if sampled is None else sampled


def prior_draws(model: Model, names: list[str], seed: int) -> dict[str, Array]:
    """Prior draws (lab units) of some reported names."""
    u, eta = _prior(model, seed)
    rng = np.random.default_rng([seed, 3])
    full = np.concatenate([eta, rng.standard_normal((len(u), sum(model.linear_sizes[1:])))], axis=1)
    listed = reported(model, Draws(u, model.values(u), full, 1), seed)
    return {item.name: item.draws for item in listed if item.name in names}
