"""The sensor's noise by itself: read off what is too fast for any muscle, before any model is fitted.

Windows inside strokes and differences of repeated strokes (:mod:`mpam_calib.criticism.noise_windows`) tell it
together, where they do not contradict each other.

Where the declaration lets the noise grow with the force, windows at small and at large forces tell how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mpam_calib.criticism.noise_windows import DEGREE, Windows, between_strokes, inside_strokes, whole_strokes
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
ABSENT = {WHITE: 1.0, CORRELATED: 0.0, TIME: 1.0, GROWTH: 0.0}
"""What stands for a size that the model does not have."""
CONTRADICTS = 20.0
"""Nats that strokes and their differences may lose by one noise for both. With sensors' noise they lose up to
twelve, with structure that only one of them sees a hundred."""


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
    inside = _believed([inside_strokes(loops, degree) for degree in range(DEGREE, HIGHEST + 1)], loops, model)
    across = _believed([between_strokes(loops)], loops, model)
    if inside is None or across is None:
        told = inside or across
        alone = whole_strokes(loops) if told is None else told.windows
        return None if alone is None else _mode([alone], loops.averaged, model)
    both = _mode([inside.windows, across.windows], loops.averaged, model)
    lost = sum(_lost(told, both, loops.averaged, model) for told in (inside, across))
    return both if lost <= CONTRADICTS else min(inside, across, key=lambda told: told.typical).level


class _Told(NamedTuple):
    """Windows, what they alone say of the noise, and its sd at a typical force (N)."""

    windows: Windows
    level: NoiseLevel
    typical: float


def _believed(cut: Sequence[Windows | None], loops: Loops, model: Model) -> _Told | None:
    """The first windows, by rising degree, that leave hardly more than others do; None if there are none."""
    scale = 1.0 if model.setting is None else model.setting.force_scale
    every: list[_Told] = []
    for windows in cut:
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

    def level(u: Array) -> NoiseLevel:
        given = {name: float(priors[name].from_normal(u[i : i + 1])[0]) for i, name in enumerate(names)}
        return NoiseLevel(*(given.get(name, absent) for name, absent in ABSENT.items()))

    def negative(u: Array) -> float:
        if np.any(np.abs(u) > 12.0):
            return 1e12
        noise = level(u)
        return float(0.5 * u @ u) - sum(_log_likelihood(w, noise, averaged, scale) for w in usual)

    usual = [windows.usual(GROWTH in names) for windows in seen]
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
    return level(end.x)


def _lost(told: _Told, noise: NoiseLevel, averaged: int, model: Model) -> float:
    """Nats that windows lose by another noise than their own."""
    scale = 1.0 if model.setting is None else model.setting.force_scale
    usual = told.windows.usual(GROWTH in model.names)
    own, other = (_log_likelihood(usual, n, averaged, scale) for n in (told.level, noise))
    return own - other


def _log_likelihood(windows: Windows, noise: NoiseLevel, averaged: int, scale: float) -> float:
    """Log likelihood (nats) of what usual windows see; growth is stated for the force ``scale``, N."""
    sizes = [np.array([size]) for size in (noise.white, noise.correlated, noise.time)]
    if noise.growth == 0.0:
        return float(fast_noise_log_likelihood(windows.scatter, averaged, *sizes)[0])
    covariance = fast_noise_covariance(windows.scatter, averaged, *sizes)
    grows = grown(np.array([[noise.growth]]), windows.force, scale)
    return float(chunk_log_likelihood(covariance, windows.chunks, grows)[0])
