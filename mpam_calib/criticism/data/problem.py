"""The data as every hypothesis sees them: reduced rows, their noise, and a remainder of several sizes.

The noise is known before any model is fitted (:mod:`mpam_calib.criticism.data.noise_level`), growing with the
force where it is declared to (and the recording tells: static readings alone do not), so for each
size of the remainder the covariance is one fixed matrix, and a hypothesis is a small least-squares
problem. The remainder is rich (many half-waves, apart for every branch and, more weakly, for every
stroke and distant pressure), so that it can hold what nobody thought of.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from mpam_calib.criticism.data.noise_level import NoiseLevel
from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.data.whitening import Axes, Whitening
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.readings import Readings
from mpam_calib.model.state import Setting
from mpam_calib.model.tensile import half_waves

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

HALF_WAVES = 24
SIZES = (0.0, 0.002, 0.008, 0.03)
"""Sizes of the remainder as shares of the force scale."""
SIZE_PRIOR = (0.7, 0.1, 0.1, 0.1)
STROKE_SHARE = 0.35
"""Size of each stroke's own part of the remainder, as a share of the common part."""
PRESSURE_LENGTH = 0.08
"""Distance in pressure (share of the top level) over which the remainder changes."""
LONG, FAST_SHARE, CURVED = 0.04, 0.3, 0.1
"""A row longer than this share of the stroke, or of its way since the turn, or along which the force is
curved by more than this share of the row's noise, is looked at in two places."""

SANE = 3.0
"""Prior sds beyond which known moduli are not believed to bend as they say."""
INHERITED = ("model", "lean", "bow", "root", "axes", "spreads", "log_dets")
"""What other forces do not change, or hardly."""


@dataclass(frozen=True)
class Problem:
    """Reduced rows (n,): two Gauss points each in ``readings`` (2n), ``force`` (N), and where they belong.

    ``level``, ``cycle`` and ``stroke`` (n,) group the rows; ``noise`` (n, n) is the covariance of the
    readings' noise, of which ``tied`` (n, r) is the factor of what strokes share; ``kernel`` (n, n) the
    remainder's for size 1 N. ``saturated`` is the share of raw readings at the end of the load cell's range
    (left out), ``rows`` holds the others.
    """

    blueprint: Blueprint
    readings: Readings
    force: Array
    level: Ints
    cycle: Ints
    stroke: Ints
    noise: Array
    tied: Array
    kernel: Array
    noise_level: NoiseLevel
    has_clock: bool
    saturated: float = 0.0
    rows: Rows | None = None
    noise_guessed: bool = False
    """Whether no sd is declared and the readings are too few to tell it (force maps)."""

    @cached_property
    def model(self) -> Model:
        """The declared simulation, without nuisances or remainder."""
        return build_model(self.blueprint)

    @cached_property
    def declared(self) -> str:
        """The blueprint as JSON: what a chain of the declared simulation is kept by."""
        return self.blueprint.model_dump_json()

    @property
    def setting(self) -> Setting:
        """The setting of the muscle and its test."""
        assert self.model.setting is not None
        return self.model.setting

    @cached_property
    def force_scale(self) -> float:
        """The specimen's size of a force, N."""
        return self.setting.force_scale

    @property
    def cycles(self) -> Ints:
        """The cycles of the loops; a static reading belongs to none."""
        return np.unique(self.cycle[self.stroke >= 0])

    def __len__(self) -> int:
        return len(self.force)

    def middle(self) -> Readings:
        """One reading per row."""
        return self.readings.middles()

    @cached_property
    def lean(self) -> tuple[Readings, Ints, Ints]:
        """The readings (m,) that a fit needs, and the two (n,) whose mean each row is.

        A row's middle is enough where the row is short, the force straight, and no turn is near, where the
        friction changes.
        """
        n = len(self)
        x, travel = self.readings.displacement, self.readings.travel
        width = np.abs(x[n:] - x[:n])
        both = width > LONG * self.setting.stroke
        both |= width > FAST_SHARE * np.minimum(travel[n:], travel[:n])
        both |= np.abs(self._curvature) > CURVED * np.sqrt(np.diagonal(self.noise))
        one, two = np.flatnonzero(~both), np.flatnonzero(both)
        readings = Readings.join(
            [self.middle().take(one), self.readings.take(two), self.readings.take(two + n)]
        )
        first = np.empty(n, dtype=np.intp)
        first[one], first[two] = np.arange(len(one)), len(one) + np.arange(len(two))
        return readings, first, np.where(both, first + len(two), first)

    def at_lean(self, rows: Array) -> Array:
        """What the rows (n,) say at the lean readings, (m,)."""
        readings, first, second = self.lean
        result = np.empty(len(readings))
        result[first], result[second] = rows, rows
        return result

    @cached_property
    def bow(self) -> Array:
        """What the mean force of each row (n,) is above the force at its places in ``lean``, N.

        From the declared simulation: effects hardly change it where it is small.
        """
        _, first, second = self.lean
        return np.where(first == second, self._curvature, 0.0)

    @cached_property
    def _curvature(self) -> Array:
        """What the mean force of each row (n,) is above that in its middle, N: the declared simulation's."""
        chain, n = self.model.chain, len(self)
        assert chain is not None
        values = {p.name: p.prior.from_normal(np.zeros((1, 1))) for p in chain.parameters} or {
            "": np.zeros((1, 1))
        }
        readings = Readings.join([self.readings, self.middle()])
        terms = chain.terms(values, readings, np.tile(self.force, 3))
        fixed = np.broadcast_to(terms.fixed, (1, 3 * n))[0]
        columns = np.broadcast_to(terms.columns, (1, 3 * n, chain.linear_size))[0]
        X = columns / self.noise_level.total
        residual = (np.tile(self.force, 3) - fixed) / self.noise_level.total
        eta = linalg.solve(X.T @ X + np.eye(X.shape[1]), X.T @ residual) if X.shape[1] else np.zeros(0)
        if self.model.blueprint.simulation.moduli != "loops":
            # Known moduli far out of their prior stand in for something that is bent elsewhere.
            eta = eta * min(1.0, SANE / max(float(np.abs(eta).max(initial=0.0)), SANE))
        low, high, middle = (fixed + columns @ eta).reshape(3, n)
        return np.asarray(0.5 * (low + high) - middle)

    def take(self, rows: NDArray[np.bool_]) -> Problem:
        """The problem on some of its rows (a fold)."""
        index = np.flatnonzero(rows)
        return replace(
            self,
            readings=self.readings.take(np.concatenate([index, index + len(self)])),
            force=self.force[index],
            level=self.level[index],
            cycle=self.cycle[index],
            stroke=self.stroke[index],
            noise=self.noise[np.ix_(index, index)],
            tied=self.tied[index],
            kernel=self.kernel[np.ix_(index, index)],
            rows=None,
        )

    def with_force(self, force: Array) -> Problem:
        """The same design with other forces (n,), N; the covariance's factors and the bow are taken over."""
        made = replace(self, force=force)
        made.__dict__.update({name: getattr(self, name) for name in INHERITED})
        return made

    def with_noise_scale(self, scale: float) -> Problem:
        """The same with rows whose noise has an sd ``scale`` times as large.

        ``noise_level``, which is that of single readings, stays.
        """
        made = replace(self, noise=scale**2 * self.noise, tied=scale * self.tied)
        made.__dict__.update({name: getattr(self, name) for name in ("model", "lean", "bow")})
        made.__dict__.update(root=self.root.scaled(scale), axes=self.axes.scaled(scale))
        return made

    def with_free_strokes(self) -> Problem:
        """The same with a remainder in which each stroke has as much of its own as it shares."""
        made = replace(self, kernel=kernel(self, 1.0))
        made.__dict__.update({name: getattr(self, name) for name in ("model", "lean", "bow", "root")})
        return made

    def covariance(self, size: float) -> Array:
        """Noise and a remainder of ``size`` (share of the force scale), N²."""
        return self.noise + (size * self.force_scale) ** 2 * self.kernel

    def white(self, columns: Array, size: int) -> Array:
        """Columns (n, ...) whitened by the covariance of SIZES[size].

        Without a remainder strokes are nearly apart; with one the axes serve all sizes.
        """
        if size == 0:
            return self.root @ columns
        turned = self.axes @ columns
        return np.asarray(turned / self.spreads[size].reshape(-1, *[1] * (columns.ndim - 1)))

    @cached_property
    def root(self) -> Whitening:
        """What whitens the noise alone."""
        return Whitening.build(self.noise, self.tied)

    @cached_property
    def axes(self) -> Axes:
        """What whitens the noise and parts the remainder, whose size need not be known for it.

        For every size the covariance is diagonal on these axes: 1 + (size·force scale)²·power.
        """
        return Axes.build(self.noise, self.kernel)

    @cached_property
    def spreads(self) -> list[Array]:
        """Standard deviations along the axes for each of SIZES."""
        powers = self.axes.powers
        return [np.sqrt(1.0 + (size * self.force_scale) ** 2 * powers) for size in SIZES]

    @cached_property
    def log_dets(self) -> list[float]:
        """ln|C| for each of SIZES."""
        return [self.axes.log_det + 2.0 * float(np.sum(np.log(spread))) for spread in self.spreads]


def kernel(problem: Problem, own_share: float = STROKE_SHARE) -> Array:
    """The remainder's covariance for size 1 N (rank at most that of its half-waves)."""
    setting = problem.setting
    readings = problem.middle()
    waves = half_waves(readings.displacement / max(setting.stroke, 1e-9), HALF_WAVES)
    along = waves @ waves.T
    pressure = readings.pressure / setting.top_pressure
    apart = np.exp(-np.abs(pressure[:, None] - pressure) / PRESSURE_LENGTH)
    branch = readings.sign[:, None] == readings.sign
    own = (problem.stroke[:, None] == problem.stroke) & (problem.stroke >= 0)[:, None]
    result: Array = along * (apart * branch + own_share**2 * own)
    return result
