"""The sensor's noise by itself: read off what is too fast for any muscle, before any model is fitted.

Where the declaration lets the noise grow with the force, windows at small and at large forces tell how much.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mpam_calib.model.model import Model
from mpam_calib.model.noise import CORRELATED, GROWTH, TIME, WHITE, grown
from mpam_calib.posterior.covariance import fast_noise_covariance, fast_noise_log_likelihood
from mpam_calib.posterior.sites import chunk_log_likelihood, usual_chunks
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

WINDOW, DEGREE, HIGHEST = 32, 3, 6
"""Windows of at most so many rows, detrended by a polynomial of the first degree, or of up to the second
where the curve itself would pass for noise ..."""
SHORT_DEGREE = 5
"""... or of this one, where a stroke is so short that it is one window."""
LEFT = 1.15
"""Times the noise that a higher degree leaves up to which a lower one is believed: it tells more."""
COMES_BACK = 0.6
"""Share of the scatter inside strokes below which that between repeated strokes is believed."""
USUAL = 4.0
"""Multiple of the typical power above which a window holds more than noise."""
FEWEST_PAIRS = 6
"""Pairs of repeated strokes that are enough to tell the noise from."""


@dataclass(frozen=True)
class NoiseLevel:
    """White and correlated sd (N) and the latter's time constant (s); how all of it grows with the force."""

    white: float
    correlated: float
    time: float
    growth: float = 0.0

    @property
    def total(self) -> float:
        """sd of one reading, at no force."""
        return float(np.hypot(self.white, self.correlated))


def noise_level(loops: Loops, model: Model) -> NoiseLevel | None:
    """Posterior mode of the noise under the model's priors; None where the strokes are too short to tell.

    What a polynomial leaves of a window is noise and the muscle's own curve: the lowest degree is taken that
    leaves hardly more than higher ones. A ripple of the drive is as fast as noise, but comes back: where
    strokes that repeat each other differ by much less than each scatters, their differences are the noise.
    """
    windows = [w for degree in range(DEGREE, HIGHEST + 1) if (w := noise_windows(loops, degree)) is not None]
    if not windows:
        return None
    every = [_mode(w, loops.averaged, model) for w in windows]
    scale = 1.0 if model.setting is None else model.setting.force_scale
    typical = [
        each.total * float(np.mean(grown(np.array(each.growth), w.force, scale)))
        for each, w in zip(every, windows, strict=True)
    ]
    found = next(each for each, size in zip(every, typical, strict=True) if size <= LEFT * min(typical))
    pairs = _between_cycles(loops)
    if pairs is not None:
        between = _mode(pairs, loops.averaged, model)
        if between.total < COMES_BACK * found.total:
            return between
    return found


def _mode(found: Windows, averaged: int, model: Model) -> NoiseLevel:
    """Posterior mode given what windows see."""
    names = [name for name in (WHITE, CORRELATED, TIME, GROWTH) if name in model.names]
    priors = {p.name: p.prior for p in model.parameters}
    scale = 1.0 if model.setting is None else model.setting.force_scale
    found = found.usual(GROWTH in names)
    scatter = found.scatter

    def values(u: Array) -> list[Array]:
        given = {name: priors[name].from_normal(u[i : i + 1]) for i, name in enumerate(names)}
        absent = {WHITE: 1.0, CORRELATED: 0.0, TIME: 1.0, GROWTH: 0.0}
        return [given.get(name, np.array([absent[name]])) for name in absent]

    def negative(u: Array) -> float:
        if np.any(np.abs(u) > 12.0):
            return 1e12
        *sizes, growth = values(u)
        if GROWTH in names:
            covariance = fast_noise_covariance(scatter, averaged, *sizes)
            likelihood = chunk_log_likelihood(
                covariance, found.chunks, grown(growth[:, None], found.force, scale)
            )
        else:
            likelihood = fast_noise_log_likelihood(scatter, averaged, *sizes)
        return float(0.5 * u @ u - likelihood[0])

    # Left to itself the search starts with steps of 0.00025 at zero, and ends there.
    start = np.zeros(len(names))
    end = optimize.minimize(
        negative,
        start,
        method="Nelder-Mead",
        options={
            "maxiter": 600,
            "xatol": 1e-3,
            "initial_simplex": np.concatenate([start[None], np.eye(len(names))]),
        },
    )
    return NoiseLevel(*(float(v[0]) for v in values(end.x)))


class Windows(NamedTuple):
    """What the contrasts of windows see (k, dof), the windows' mean forces (k,), contrasts, time step (s)."""

    chunks: Array
    force: Array
    contrast: Array
    dt: float

    def usual(self, grows: bool) -> Windows:
        """Without bursts and snaps, which must not pass for noise.

        They are far above the typical window, or above those of similar force where noise grows with it.
        """
        if grows:
            kept = usual_chunks(self.chunks, self.force)
            return self._replace(chunks=self.chunks[kept], force=self.force[kept])
        power = np.mean(self.chunks**2, axis=1)
        kept = power <= USUAL * np.median(power)
        return self._replace(chunks=self.chunks[kept], force=self.force[kept])

    @property
    def scatter(self) -> tuple[Array, int, Array, float]:
        """As the likelihood of fast noise takes it."""
        return self.chunks.T @ self.chunks, len(self.chunks), self.contrast, self.dt


def noise_windows(loops: Loops, degree: int = DEGREE) -> Windows | None:
    """Detrended windows of consecutive rows inside strokes, away from their ends; None where there are none.

    Where strokes are too short for any degree, those that repeat each other are compared, or each is one
    window.
    """
    first, length = loops.strokes
    typical = int(np.median(length))
    size, margin = min(WINDOW, typical // 4), max(min(WINDOW, typical // 4) // 4, 2)
    if size < degree + 3 and degree > DEGREE:
        return None
    if size < DEGREE + 4 and (found := _between_cycles(loops)) is not None:
        return found
    if size < DEGREE + 4:
        # The whole stroke, with a stiffer curve taken out: differences of far rows see the curve itself.
        size, degree, margin = min(WINDOW, int(np.quantile(length, 0.25))), SHORT_DEGREE, 0
    if size < degree + 3:
        return None
    starts = [
        np.arange(f + margin, f + n - margin - size + 1, size)
        for f, n in zip(first, length, strict=True)
        if n >= size + 2 * margin
    ]
    rows = np.concatenate(starts) if starts else np.empty(0, dtype=np.int64)
    if len(rows) < 4:
        return None
    index = rows[:, None] + np.arange(size)
    index = index[~loops.censored[index].any(axis=1)]
    if len(index) < 4:
        return None
    dt = float(np.median((loops.time_s[index[:, -1]] - loops.time_s[index[:, 0]]) / (size - 1)))
    return _detrended(loops.force_N[index], loops.force_N[index].mean(axis=1), degree, dt)


def _between_cycles(loops: Loops) -> Windows | None:
    """The same from differences of strokes that repeat each other: short strokes leave no other way.

    What the muscle does, and whatever is wrong with it, comes back in the next cycle; noise does not.
    """
    first, length = loops.strokes
    groups: dict[tuple[int, int, int], list[int]] = {}
    for stroke, (f, n) in enumerate(zip(first, length, strict=True)):
        if not loops.censored[f : f + n].any():
            groups.setdefault((int(loops.level[f]), int(loops.branch[f]), int(n)), []).append(int(stroke))
    pairs = np.array([pair for g in groups.values() for pair in zip(g[0::2], g[1::2], strict=False)])
    if len(pairs) < FEWEST_PAIRS:
        return None
    size = min(WINDOW, int(length[pairs[:, 0]].min()))
    if size < DEGREE + 4:
        return None
    rows = first[pairs][:, :, None] + np.arange(size)
    difference = (loops.force_N[rows[:, 0]] - loops.force_N[rows[:, 1]]) / np.sqrt(2.0)
    dt = float(np.median((loops.time_s[rows[:, 0, -1]] - loops.time_s[rows[:, 0, 0]]) / (size - 1)))
    return _detrended(difference, loops.force_N[rows].mean(axis=(1, 2)), DEGREE, dt)


def _detrended(windows: Array, force: Array, degree: int, dt: float) -> Windows:
    """Windows (k, size) less a polynomial, with their mean forces (k,)."""
    size = windows.shape[1]
    full, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, size), degree + 1), mode="complete")
    contrast = np.asarray(full[:, degree + 1 :], dtype=np.float64)
    return Windows(windows @ contrast, force, contrast, max(dt, 1e-9))
