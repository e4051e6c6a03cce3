"""The problem that a specimen poses: its readings reduced to rows, and the noise of these."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from mpam_calib.criticism.data.noise_level import NoiseLevel, noise_level
from mpam_calib.criticism.data.problem import Problem, kernel
from mpam_calib.criticism.data.rows import Rows, telling_points, telling_strokes
from mpam_calib.criticism.data.saturation import along_a_ceiling
from mpam_calib.criticism.data.static_noise import static_noise
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.model import build_model
from mpam_calib.model.noise import grown
from mpam_calib.model.readings import Readings
from mpam_calib.model.state import Setting
from mpam_calib.posterior.likelihood.bins import LoopBins, bin_loops
from mpam_calib.posterior.likelihood.covariance import StrokeCovariance
from mpam_calib.posterior.likelihood.points import Points, gather_points
from mpam_calib.posterior.tested_moduli import moduli_of_test
from mpam_calib.specimen.extremes import saturated
from mpam_calib.specimen.recording import Loops, Specimen
from mpam_calib.specimen.summary import force_noise

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

ROWS = 480
"""About so many reduced rows; the covariance is dense."""
NOISE_UNKNOWN = 1e-3
"""Noise of a reading (N) where there are too few to tell it and no sensor sd is declared."""
FORCE_MAP_NOISE = 0.003
"""Noise of a static reading as a share of the force scale, where no sd is declared and too few tell it."""
ALIKE, APART = 0.9, 0.5
"""How alike the rests of two strokes are, and the share of what is left that every bin of a rest has by
itself: friction fades on the way into a rest, and in it."""


class _Part(NamedTuple):
    """Rows (n,) of one kind of data: their two places, forces (N) and strokes (-1: none).

    ``noise`` (n, n), N², is the covariance of what each stroke has by itself, ``tied`` (n, 2), N, the factor
    of what the strokes share.
    """

    low: Readings
    high: Readings
    force: Array
    stroke: Ints
    noise: Array
    tied: Array


def build_problem(specimen: Specimen, blueprint: Blueprint) -> Problem:
    """Reduce a specimen's muscle data; ``blueprint`` is the declared simulation's without nuisances.

    The moduli of a tensile test have their prior from it.
    """
    if blueprint.material is None and (tested := moduli_of_test(specimen)) is not None:
        blueprint = blueprint.model_copy(update={"material": tested})
    model = build_model(blueprint)
    setting = model.setting
    assert setting is not None
    parts: list[_Part] = []
    noise: NoiseLevel | None = None
    guessed, beyond, loops, points = False, 0.0, specimen.loops, gather_points(specimen)
    if loops is not None:
        every = len(loops.force_N)
        loops = loops.without(saturated(loops))
        noise = noise_level(loops, model)
        if noise is not None:
            loops = loops.without(along_a_ceiling(loops, noise.total))
        beyond = 1.0 - len(loops.force_N) / every
        noise = noise or _noise_of_few(loops, setting)
        parts.append(_part_of_loops(loops, noise, setting))
    if points is not None:
        if noise is None:
            noise, guessed = _noise_of_static(points, setting)
        parts.append(_part_of_points(points, noise, setting))
    assert noise is not None
    low = Readings.join([part.low for part in parts])
    high = Readings.join([part.high for part in parts])
    stroke = np.concatenate([part.stroke for part in parts])
    nearest = np.abs(low.pressure[:, None] - setting.levels).argmin(axis=1)
    tied = np.concatenate([part.tied for part in parts])
    problem = Problem(
        blueprint=blueprint,
        readings=Readings.join([low, high]),
        force=np.concatenate([part.force for part in parts]),
        level=np.where(low.level >= 0, low.level, nearest),
        cycle=np.where(stroke >= 0, low.cycle, 0).astype(np.int64),
        stroke=stroke,
        noise=linalg.block_diag(*[part.noise for part in parts]) + tied @ tied.T,
        tied=tied,
        kernel=np.zeros((0, 0)),
        noise_level=noise,
        has_clock=loops is not None,
        saturated=beyond,
        rows=None if loops is None else Rows.of(loops),
        noise_guessed=guessed,
    )
    return replace(problem, kernel=kernel(problem))


def _noise_of_few(loops: Loops, setting: Setting) -> NoiseLevel:
    """White noise, declared or between neighbours, where loops are too few to tell it."""
    guess = setting.force_sd or float(np.nan_to_num(force_noise(loops.clear)))
    return NoiseLevel(guess or NOISE_UNKNOWN, 0.0, 1.0)


def _noise_of_static(points: Points, setting: Setting) -> tuple[NoiseLevel, bool]:
    """White noise of static readings, and whether nothing told it."""
    level = points.level(setting.levels)
    told = setting.force_sd or static_noise(points, level, setting.force_scale)
    return NoiseLevel(told or FORCE_MAP_NOISE * setting.force_scale, 0.0, 1.0), not told


def _part_of_loops(loops: Loops, noise: NoiseLevel, setting: Setting) -> _Part:
    """Bins of the strokes that are looked at, but slack ones."""
    looked_at = telling_strokes(loops.clear)
    bins = bin_loops(loops, int(np.clip(ROWS // len(looked_at), 8, 32)), finest=1)
    keep = np.flatnonzero(~bins.slack & np.isin(bins.segment, looked_at))
    force = bins.force[keep]
    larger = grown(np.array(noise.growth), force, setting.force_scale)
    own, shared = _doubt_at_rest(bins, keep)
    return _Part(
        low=bins.readings.take(keep),
        high=bins.readings.take(keep + len(bins)),
        force=force,
        stroke=bins.segment[keep],
        noise=larger[:, None] * larger * _noise_of_strokes(bins, keep, noise) + own,
        tied=shared,
    )


def _part_of_points(points: Points, noise: NoiseLevel, setting: Setting) -> _Part:
    """Static readings that tell of the muscle: one place each, and no stroke."""
    keep, _ = telling_points(points)
    readings, force = points.readings.take(keep), points.force[keep]
    sd = noise.total * grown(np.array(noise.growth), force, setting.force_scale)
    none = np.full(len(keep), -1)
    return _Part(readings, readings, force, none, np.diag(sd**2), np.zeros((len(keep), 2)))


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


def _doubt_at_rest(bins: LoopBins, keep: Ints) -> tuple[Array, Array]:
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
