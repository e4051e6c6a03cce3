"""The fit at the readings: the declared simulation without its remainder, and how large that is.

How a simulation and its remainder share what both can describe is arbitrary: here the simulation has all
of it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.noise import CORRELATED, WHITE
from mpam_calib.model.readings import Readings
from mpam_calib.model.remainder import SMOOTH
from mpam_calib.model.tensile import NOISE
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.bands import stress_draws

Array = NDArray[np.float64]

STEP = 0.1
"""Change of a standard normal coordinate that shows how the force follows it."""


def fitted_force(model: Model, draws: Draws, readings: Readings) -> tuple[Array, Array]:
    """Mean force (n,) of the simulation, N, and the remainder's mean square (n,), N²."""
    assert model.chain is not None
    p, q, _ = model.linear_sizes
    force = model.chain.force(draws.values, draws.eta[:, :p], readings)
    square = np.zeros(len(readings))
    if model.remainder is not None:
        surface = draws.values[SMOOTH] * (draws.eta[:, p : p + q] @ model.remainder.columns(readings).T)
        taken = _taken_up(surface, _directions(model, draws, readings), noise_of(draws))
        force = force + taken
        square = np.mean((surface - taken) ** 2, axis=0)
    return force.mean(axis=0), square


def past_force(model: Model, draws: Draws, readings: Readings) -> Array:
    """Mean force (n,), N, by which readings lie off those of the settled muscle, of which all bands are.

    They owe it to the cycles, times and speeds of the test until then, and to a load cell that wandered.
    """
    assert model.chain is not None
    eta = draws.eta[:, : model.linear_sizes[0]]
    then, settled = (model.chain.force(draws.values, eta, rows) for rows in (readings, readings.settled()))
    off: Array = (then - settled).mean(axis=0)
    return off


def fitted_stress(model: Model, draws: Draws, strain: Array) -> tuple[Array, Array]:
    """Mean stress (n,) of the law at strains (n,), Pa, and the remainder's mean square (n,), Pa²."""
    assert model.tensile is not None
    stress = stress_draws(model, draws, strain, remainder=False)
    surface = stress_draws(model, draws, strain) - stress
    noise = float(np.mean(draws.values[NOISE] ** 2))
    taken = _taken_up(surface, np.abs(stress).max() * model.tensile.powers(strain).T, noise**0.5)
    return (stress + taken).mean(axis=0), np.mean((surface - taken) ** 2, axis=0)


def noise_of(draws: Draws) -> float:
    """Noise (N) of a reading at small forces; of heavy-tailed noise, its scale."""
    square = draws.values[WHITE] ** 2
    if CORRELATED in draws.values:
        square = square + draws.values[CORRELATED] ** 2
    return float(np.sqrt(np.mean(square)))


def _directions(model: Model, draws: Draws, readings: Readings) -> Array:
    """How the force (n,) at the posterior's centre changes with each coordinate that moves it (k, n)."""
    assert model.chain is not None
    p, d = model.linear_sizes[0], len(model.chain.parameters)
    u = np.tile(draws.u.mean(axis=0), (d + p + 1, 1))
    eta = np.tile(draws.eta[:, :p].mean(axis=0), (d + p + 1, 1))
    u[:d, :d] += STEP * np.eye(d)
    eta[d : d + p] += STEP * np.eye(p)
    force = model.chain.force(model.values(u), eta, readings)
    change: Array = (force[:-1] - force[-1]) / STEP
    return change


def _taken_up(surface: Array, columns: Array, noise: float) -> Array:
    """The part of a remainder (N, n) that coordinates with columns (k, n) could take up."""
    gram = columns @ columns.T + noise**2 * np.eye(len(columns))
    taken: Array = np.linalg.solve(gram, columns @ surface.T).T @ columns
    return taken
