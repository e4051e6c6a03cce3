"""Draws of whole force-contraction curves, remainder included."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.model import CONTRACTION_SD, Model
from mpam_calib.model.readings import Readings
from mpam_calib.model.reference import geometric_contraction, rest_of
from mpam_calib.model.remainder import ROUGH
from mpam_calib.physics.kinematics import SHAPES
from mpam_calib.physics.statics import gas_force, thickness_force
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.draws import Draws
from mpam_calib.posterior.likelihood.covariance import ROUGH_LENGTH
from mpam_calib.prediction.beyond import Beyond
from mpam_calib.prediction.free_moduli import moduli_change
from mpam_calib.prediction.reading_noise import ReadingNoise

Array = NDArray[np.float64]

STEP = 0.005
BRANCHES = ("loading", "unloading", "mean")
BATCH_CELLS = 400_000
"""Draws × readings evaluated at once: bounds the memory."""
LIMIT = 0.6
"""Largest contraction that is looked at."""
GRID = np.arange(round(LIMIT / STEP) + 1, dtype=np.float64) * STEP
"""Contractions on which the first root is looked for, shape (γ,)."""
PAST, SHORT = 0.02, 0.05
"""Shares of the recorded contraction beyond its ends that are still as recorded: a test begins with some
slack taken up."""
OUTSIDE = 0.01
"""Share of the largest recorded pressure by which a pressure may miss the recorded ones."""
BEYOND = 1.1
"""Curves are drawn so many times as far as any muscle comes."""


@dataclass(frozen=True)
class Curves:
    """Force draws, N: ``force`` (N, pressures, 3 branches, contractions), in the order of BRANCHES.

    ``noise`` (what a new reading adds) and ``contraction_noise`` (N,), its sd.
    """

    force: Array
    noise: ReadingNoise
    contraction_noise: Array


def contraction_grid(model: Model, reach: float) -> Array:
    """0, 0.005, … a little beyond the data's reach and where the gas, on braid and wall, stops pulling.

    A bladder that it stretches takes from that pull: the free contraction lies before.
    """
    assert model.setting is not None
    geometry, kinematics = model.setting.geometry, model.setting.simulation.kinematics
    shape = SHAPES[kinematics](geometry.L0 * (1.0 - GRID), rest_of(geometry))
    pressure = np.array(model.setting.top_pressure)
    pull = gas_force(pressure, shape) + thickness_force(pressure, shape)
    end = max(float(first_root(GRID, pull).max()), geometric_contraction(geometry), reach)
    return GRID[: int(np.ceil(min(LIMIT, BEYOND * end) / STEP)) + 1]


def force_curves(model: Model, draws: Draws, pressures: Array, contractions: Array, seed: int) -> Curves:
    """Curves at pressures (Pa, the gauge's reading) and contractions, for every draw.

    The muscle is settled: after many cycles, just after the level was reached, at the reference speed. Below
    and above all levels the remainder is that of :mod:`~mpam_calib.prediction.beyond`. A pressure's draws
    are the same whichever others are asked for.
    """
    assert model.setting is not None
    L0 = model.setting.geometry.L0
    shape = (len(pressures), len(BRANCHES), len(contractions))
    sign = np.array([1.0, -1.0, 0.0])[None, :, None]
    grid = np.broadcast_arrays(pressures[:, None, None], L0 * contractions[None, None, :], sign)
    readings = Readings.at_rest(*(g.ravel() for g in grid))
    beyond, p = Beyond.draw(model, draws, seed), model.linear_sizes[0]
    parts, changed = [], []
    size = max(1, BATCH_CELLS // len(readings))
    for i in range(0, len(draws), size):
        values = {k: v[i : i + size] for k, v in draws.values.items()}
        parts.append(predict_force(model, values, draws.eta[i : i + size], readings))
        if beyond is not None and model.chain is not None:
            own, unknown = draws.eta[i : i + size, :p], beyond.unknown[i : i + size]
            change = moduli_change(model.chain, values, own, readings, unknown)
            changed += [] if change is None else [change]
    force = np.concatenate(parts)
    if beyond is not None:
        force += beyond.force(readings, force, np.concatenate(changed) if changed else None)
    force = force.reshape(len(draws), *shape)
    if ROUGH in draws.values:
        for j, pressure in enumerate(pressures):
            force[:, j] += _stroke_remainder(model, draws, contractions, pressure_rng(seed, 4, pressure))
    zero = np.zeros(len(draws))
    own = draws.values[CONTRACTION_SD][:, 0] if CONTRACTION_SD in draws.values else zero
    noise = ReadingNoise(draws.values, model.setting.force_scale)
    return Curves(force, noise, own)


def pressure_rng(seed: int, stream: int, pressure: float) -> np.random.Generator:
    """Random numbers of one pressure (Pa): the same whichever others are asked for beside it."""
    return np.random.default_rng([seed, stream, round(float(pressure)) % 2**32])


def _stroke_remainder(model: Model, draws: Draws, contractions: Array, rng: np.random.Generator) -> Array:
    """A new stroke's own remainder (N, 3, γ) at one pressure: an exponential kernel along the contraction.

    Apart for each branch.
    """
    assert model.setting is not None
    length = ROUGH_LENGTH * model.setting.stroke / model.setting.geometry.L0
    rho = np.exp(-np.diff(contractions) / length)
    z = rng.standard_normal((len(draws), 2, len(contractions)))
    path = np.empty_like(z)
    path[..., 0] = z[..., 0]
    for i, r in enumerate(rho):
        path[..., i + 1] = r * path[..., i] + np.sqrt(1.0 - r**2) * z[..., i + 1]
    path *= draws.values[ROUGH][:, :, None]
    return np.concatenate([path, path.mean(axis=1, keepdims=True)], axis=1)


def first_root(contractions: Array, force: Array) -> Array:
    """First root of curves (..., contractions): 0 where F(0) <= 0, the last contraction where there is none.

    Linear between grid points.
    """
    below = force <= 0.0
    index = np.where(below.any(axis=-1), below.argmax(axis=-1), -1)
    after = np.clip(index, 1, None)[..., None]
    high = np.take_along_axis(force, after - 1, axis=-1)[..., 0]
    low = np.take_along_axis(force, after, axis=-1)[..., 0]
    start, end = contractions[after[..., 0] - 1], contractions[after[..., 0]]
    drop = np.where(high > low, high - low, 1.0)
    root = start + (end - start) * np.clip(high / drop, 0.0, 1.0)
    return np.where(index == 0, 0.0, np.where(index < 0, contractions[-1], root))


def past(furthest: Array, contraction: Array) -> NDArray[np.bool_]:
    """Whether a contraction lies past the largest recorded one."""
    return np.asarray(contraction > furthest * (1.0 + PAST) + 1e-3)


@dataclass(frozen=True)
class Reach:
    """Where the data end: pressures (Pa), the largest contraction at each, and the least with a force.

    ``slack`` is the largest contraction at each up to which a reading, a slack one too, tells of the root.
    """

    pressures: Array
    contraction: Array
    onset: Array
    slack: Array

    @classmethod
    def of(cls, blueprint: Blueprint) -> Reach:
        """That of the recordings that a blueprint was drawn from."""
        levels = np.array(blueprint.levels)
        reach, none = np.array(blueprint.reach), np.zeros(len(levels))
        slack = np.maximum(reach, blueprint.slack or none)
        return cls(levels, reach, np.array(blueprint.onset or none), slack)

    def beyond(self, pressure: Array, contraction: Array) -> NDArray[np.bool_]:
        """Whether a contraction lies past the largest recorded one, interpolated."""
        return past(self.at(pressure), contraction)

    def before(self, pressure: Array, contraction: Array) -> NDArray[np.bool_]:
        """Whether a contraction lies short of the least that a force was recorded at."""
        onset = np.interp(pressure, self.pressures, self.onset)
        return np.asarray(contraction < onset - SHORT * self.at(pressure) - 1e-3)

    def at(self, pressure: Array) -> Array:
        """Largest recorded contraction, interpolated."""
        return np.interp(pressure, self.pressures, self.contraction)

    def along(self, pressure: Array, free: Array, free_at_levels: Array) -> Array:
        """Largest contraction (n,) that readings reach at pressures (n,), by what is left to the end there.

        Between two levels as large a share of the free contraction as at both of them: that grows less and
        less with the pressure, so that a straight line between two ends falls short of the ends between.
        ``free`` (n,) and ``free_at_levels`` (levels,) are free contractions, nan where there is none.
        """
        straight = self.at(pressure)
        if len(self.pressures) < 2:
            return straight
        low, high = self.neighbours(pressure)
        share = self.contraction / np.where(free_at_levels > 0.0, free_at_levels, np.nan)
        shared = np.minimum(share[low], share[high]) * free
        return np.where(self.inside(pressure), np.fmax(straight, shared), straight)

    def inside(self, pressure: Array) -> NDArray[np.bool_]:
        """Whether a pressure lies between two recorded ones, at none of them."""
        within = (pressure > self.pressures[0]) & (pressure < self.pressures[-1])
        return np.asarray(within & ~np.isin(pressure, self.pressures))

    def neighbours(self, pressure: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """The levels (n,) below and above pressures (n,), by index."""
        high = np.clip(np.searchsorted(self.pressures, pressure), 1, len(self.pressures) - 1)
        return high - 1, high

    def outside(self, pressure: Array) -> NDArray[np.bool_]:
        """Whether a pressure lies outside the recorded ones (by more than 1 %)."""
        margin = self._margin
        return np.asarray((pressure < self.pressures[0] - margin) | (pressure > self.pressures[-1] + margin))

    def between(self, pressure: Array) -> NDArray[np.bool_]:
        """Whether a pressure lies between the recorded ones, and near none of them (by the same measure)."""
        apart = np.abs(pressure[:, None] - self.pressures).min(axis=1)
        return np.asarray(~self.outside(pressure) & (apart > self._margin))

    @property
    def _margin(self) -> float:
        """Pressure (Pa) by which a gauge's reading may miss its level."""
        return OUTSIDE * float(self.pressures[-1])
