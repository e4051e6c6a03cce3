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

from mpam_calib.criticism.data.noise_level import NoiseLevel, noise_level
from mpam_calib.criticism.data.rows import Rows, telling_points, telling_strokes
from mpam_calib.criticism.data.saturation import along_a_ceiling
from mpam_calib.criticism.data.static_noise import static_noise
from mpam_calib.criticism.data.whitening import Axes, Whitening
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.noise import grown
from mpam_calib.model.readings import Readings
from mpam_calib.model.state import Setting
from mpam_calib.model.tensile import half_waves
from mpam_calib.posterior.likelihood.bins import LoopBins, bin_loops
from mpam_calib.posterior.likelihood.covariance import StrokeCovariance
from mpam_calib.posterior.likelihood.points import gather_points
from mpam_calib.posterior.tested_moduli import moduli_of_test
from mpam_calib.specimen.extremes import saturated
from mpam_calib.specimen.recording import Specimen
from mpam_calib.specimen.summary import force_noise

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ROWS = 480
"""About so many reduced rows; the covariance is dense."""
HALF_WAVES = 24
SIZES = (0.0, 0.002, 0.008, 0.03)
"""Sizes of the remainder as shares of the force scale."""
SIZE_PRIOR = (0.7, 0.1, 0.1, 0.1)
NOISE_UNKNOWN = 1e-3
"""Noise of a reading (N) where there are too few to tell it and no sensor sd is declared."""
STROKE_SHARE = 0.35
"""Size of each stroke's own part of the remainder, as a share of the common part."""
PRESSURE_LENGTH = 0.08
"""Distance in pressure (share of the top level) over which the remainder changes."""
LONG, FAST_SHARE, CURVED = 0.04, 0.3, 0.1
"""A row longer than this share of the stroke, or of its way since the turn, or along which the force is
curved by more than this share of the row's noise, is looked at in two places."""
ALIKE, APART = 0.9, 0.5
"""How alike the rests of two strokes are, and the share of what is left that every bin of a rest has by
itself: friction fades on the way into a rest, and in it."""
FORCE_MAP_NOISE = 0.003
"""Noise of a static reading as a share of the force scale, where no sd is declared and too few tell it."""

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
        made = replace(self, kernel=_kernel(self, 1.0))
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


def build_problem(specimen: Specimen, blueprint: Blueprint) -> Problem:
    """Reduce a specimen's muscle data; ``blueprint`` is the declared simulation's without nuisances.

    The moduli of a tensile test have their prior from it.
    """
    if blueprint.material is None and (tested := moduli_of_test(specimen)) is not None:
        blueprint = blueprint.model_copy(update={"material": tested})
    model = build_model(blueprint)
    assert model.setting is not None
    scale = model.setting.force_scale
    parts: list[tuple[Readings, Readings, Array, Ints]] = []
    noise: NoiseLevel | None = None
    blocks: list[Array] = []
    ties: list[Array] = []
    loops, beyond, guessed = specimen.loops, 0.0, False
    if loops is not None:
        every = len(loops.force_N)
        loops = loops.without(saturated(loops))
        noise = noise_level(loops, model)
        if noise is not None:
            loops = loops.without(along_a_ceiling(loops, noise.total))
        beyond = 1.0 - len(loops.force_N) / every
        looked_at = telling_strokes(loops.clear)
        bins = bin_loops(loops, int(np.clip(ROWS // len(looked_at), 8, 32)), finest=1)
        n = len(bins)
        keep = np.flatnonzero(~bins.slack & np.isin(bins.segment, looked_at))
        if noise is None:
            guess = model.setting.force_sd or float(np.nan_to_num(force_noise(loops.clear)))
            noise = NoiseLevel(guess or NOISE_UNKNOWN, 0.0, 1.0)
        larger = grown(np.array(noise.growth), bins.force[keep], scale)
        low, high = bins.readings.take(keep), bins.readings.take(keep + n)
        parts.append((low, high, bins.force[keep], bins.segment[keep]))
        own, shared = _held(bins, keep)
        blocks.append(larger[:, None] * larger * _noise_of_strokes(bins, keep, noise) + own)
        ties.append(shared)
    points = gather_points(specimen)
    if points is not None:
        keep, _ = telling_points(points)
        if noise is None:
            told = model.setting.force_sd or static_noise(points, points.level(model.setting.levels), scale)
            guessed = not told
            noise = NoiseLevel(told or FORCE_MAP_NOISE * scale, 0.0, 1.0)
        rows_of = points.readings.take(keep)
        parts.append((rows_of, rows_of, points.force[keep], np.full(len(keep), -1)))
        blocks.append(np.diag((noise.total * grown(np.array(noise.growth), points.force[keep], scale)) ** 2))
        ties.append(np.zeros((len(keep), 2)))
    assert noise is not None
    low = Readings.join([part[0] for part in parts])
    high = Readings.join([part[1] for part in parts])
    stroke = np.concatenate([part[3] for part in parts])
    levels = model.setting.levels
    level = np.abs(low.pressure[:, None] - levels).argmin(axis=1)
    level = np.where(low.level >= 0, low.level, level)
    tied = np.concatenate(ties)
    problem = Problem(
        blueprint=blueprint,
        readings=Readings.join([low, high]),
        force=np.concatenate([part[2] for part in parts]),
        level=level,
        cycle=np.where(stroke >= 0, low.cycle, 0).astype(np.int64),
        stroke=stroke,
        noise=linalg.block_diag(*blocks) + tied @ tied.T,
        tied=tied,
        kernel=np.zeros((0, 0)),
        noise_level=noise,
        has_clock=loops is not None,
        saturated=beyond,
        rows=None if loops is None else Rows.of(loops),
        noise_guessed=guessed,
    )
    return replace(problem, kernel=_kernel(problem))


def _noise_of_strokes(bins: LoopBins, keep: Ints, noise: NoiseLevel) -> Array:
    """Covariance (n, n), N², of the noise of these bins at small forces: none between two strokes."""
    layout = StrokeCovariance.build(bins)
    if noise.reading:
        layout = replace(layout, dt=np.full_like(layout.dt, noise.reading))
    white, correlated, time = (np.array([v]) for v in (noise.white, noise.correlated, noise.time))
    padded = layout.matrix(white, correlated, time, np.zeros(1))[0][layout.kind]
    full = np.zeros((len(keep), len(keep)))
    for segment in np.unique(bins.segment[keep]):
        rows = np.flatnonzero(bins.segment[keep] == segment)
        at = bins.position[keep[rows]]
        full[np.ix_(rows, rows)] = padded[segment][np.ix_(at, at)]
    return full


def _held(bins: LoopBins, keep: Ints) -> tuple[Array, Array]:
    """What these bins may be off by at rest: their level's friction, alike in all strokes.

    Returns each stroke's own covariance (n, n), N², and a factor (n, 2), N, of what the strokes share.
    Where the crosshead stops for a while, friction holds, fades or creeps; no model of sliding knows which.
    """
    n = len(bins)
    x, force, sign = bins.middle().displacement, bins.force, bins.readings.sign[:n]
    doubt = np.zeros(n)
    for level in np.unique(bins.readings.level[:n]):
        here = bins.readings.level[:n] == level
        up, down = (np.flatnonzero(here & (bins.rest < 0.5) & (sign == s)) for s in (1.0, -1.0))
        if len(up) < 3 or len(down) < 3:
            continue
        down = down[np.argsort(x[down])]
        half = 0.5 * (force[up] - np.interp(x[up], x[down], force[down]))
        friction = np.polynomial.Polynomial.fit(x[up], half, 1)(x)
        doubt[here] = (sign * friction * bins.rest)[here]
    doubt, sign, segment = doubt[keep], sign[keep], bins.segment[keep]
    shared = np.sqrt(ALIKE) * doubt[:, None] * (sign[:, None] == np.array([1.0, -1.0]))
    together = (1.0 - APART) * ((segment[:, None] == segment) & (sign[:, None] == sign))
    own = (1.0 - ALIKE) * doubt[:, None] * doubt * (together + APART * np.eye(len(doubt)))
    return own, shared


def _kernel(problem: Problem, own_share: float = STROKE_SHARE) -> Array:
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
