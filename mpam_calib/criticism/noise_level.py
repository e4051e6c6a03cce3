"""The sensor's noise by itself: read off what is too fast for any muscle, before any model is fitted.

Windows inside strokes and differences of repeated strokes (:mod:`mpam_calib.criticism.noise_windows`) tell it
together, where they do not contradict each other.

Where the declaration lets the noise grow with the force, windows at small and at large forces tell how much.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mpam_calib.criticism.noise_windows import DEGREE, Windows, between_strokes, inside_strokes
from mpam_calib.model.model import Model
from mpam_calib.model.noise import CORRELATED, GROWTH, TIME, WHITE, grown
from mpam_calib.posterior.covariance import fast_noise_covariance, fast_noise_log_likelihood
from mpam_calib.posterior.sites import chunk_log_likelihood
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]

HIGHEST = 6
"""Highest degree that is taken out of windows: at lower ones the curve itself could pass for noise ..."""
LEFT = 1.15
"""... and times the noise that a higher one leaves a lower one is believed up to: it tells more."""
COMES_BACK = 0.6
"""Share of what strokes and their differences say of the noise below which they contradict each other."""


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
    leaves hardly more than higher ones. A ripple of the drive is as fast as noise, but comes back in the next
    cycle; a snap does not come back, but stands out of its stroke. So where differences of strokes and the
    strokes themselves contradict each other, the smaller noise is the sensor's and the rest is structure.
    """
    inside = _believed(inside_strokes, loops, model)
    across = _believed(between_strokes, loops, model)
    if inside is None or across is None:
        found = inside or across
        return None if found is None else _mode([found.windows], loops.averaged, model)
    if across.typical < COMES_BACK * inside.typical:
        return across.level
    if inside.typical < COMES_BACK * across.typical:
        return inside.level
    return _mode([inside.windows, across.windows], loops.averaged, model)


class _Told(NamedTuple):
    """Windows, what they alone say of the noise, and its sd at a typical force (N)."""

    windows: Windows
    level: NoiseLevel
    typical: float


def _believed(cut: Callable[[Loops, int], Windows | None], loops: Loops, model: Model) -> _Told | None:
    """Windows of the lowest degree that leaves hardly more than higher ones; None where there are none."""
    every: list[_Told] = []
    scale = 1.0 if model.setting is None else model.setting.force_scale
    for degree in range(DEGREE, HIGHEST + 1):
        windows = cut(loops, degree)
        if windows is not None:
            level = _mode([windows], loops.averaged, model)
            grows = grown(np.array(level.growth), windows.force, scale)
            every.append(_Told(windows, level, level.total * float(np.mean(grows))))
    least = min((told.typical for told in every), default=0.0)
    return next((told for told in every if told.typical <= LEFT * least), None)


def _mode(seen: list[Windows], averaged: int, model: Model) -> NoiseLevel:
    """Posterior mode given what windows see."""
    names = [name for name in (WHITE, CORRELATED, TIME, GROWTH) if name in model.names]
    priors = {p.name: p.prior for p in model.parameters}
    scale = 1.0 if model.setting is None else model.setting.force_scale
    usual = [windows.usual(GROWTH in names) for windows in seen]

    def values(u: Array) -> list[Array]:
        given = {name: priors[name].from_normal(u[i : i + 1]) for i, name in enumerate(names)}
        absent = {WHITE: 1.0, CORRELATED: 0.0, TIME: 1.0, GROWTH: 0.0}
        return [given.get(name, np.array([absent[name]])) for name in absent]

    def log_likelihood(windows: Windows, sizes: list[Array]) -> Array:
        *noise, growth = sizes
        if GROWTH not in names:
            return fast_noise_log_likelihood(windows.scatter, averaged, *noise)
        covariance = fast_noise_covariance(windows.scatter, averaged, *noise)
        grows = grown(growth[:, None], windows.force, scale)
        return chunk_log_likelihood(covariance, windows.chunks, grows)

    def negative(u: Array) -> float:
        if np.any(np.abs(u) > 12.0):
            return 1e12
        sizes = values(u)
        return float(0.5 * u @ u - sum(log_likelihood(windows, sizes)[0] for windows in usual))

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
