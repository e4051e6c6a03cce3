"""The sensor's noise by itself: read off what is too fast for any muscle, before any model is fitted.

Windows inside strokes and differences of repeated strokes
(:mod:`mpam_calib.criticism.data.noise_windows`) tell it together, where they do not contradict each other.

Where the declaration lets the noise grow with the force, windows at small and at large forces tell how much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mpam_calib.criticism.data.noise_windows import (
    DEGREE,
    Windows,
    between_strokes,
    inside_strokes,
    whole_strokes,
)
from mpam_calib.model.model import Model
from mpam_calib.model.noise import CORRELATED, GROWTH, SHORTEST, TIME, WHITE, grown
from mpam_calib.model.priors import LogUniform, Prior
from mpam_calib.posterior.likelihood.scatter import FastScatter
from mpam_calib.posterior.likelihood.sites import chunk_log_likelihood
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]

HIGHEST = 6
"""Highest degree that is taken out of windows: at lower ones the curve itself could pass for noise ..."""
LEFT = 1.15
"""... and times the noise that a higher one leaves a lower one is believed up to: it tells more."""
ABSENT = {WHITE: 1.0, CORRELATED: 0.0, TIME: 1.0, GROWTH: 0.0}
"""What stands for a size that the model does not have."""
BRIEF = 0.7
"""Times the shortest correlation that calibration knows: noise of a digital filter may end with the next
reading, and what is told as longer is told as larger."""
CONTRADICTS = 20.0
"""Nats that strokes and their differences may lose by one noise for both. With sensors' noise they lose up to
twelve, with structure that only one of them sees a hundred."""


@dataclass(frozen=True)
class NoiseLevel:
    """White and correlated sd (N) and the latter's time constant (s); how all of it grows with the force.

    Where the correlated noise lasts for some readings, however fast these follow each other (an export of so
    many rows a stroke), ``reading`` is the time (s) by which each of them counts; else 0.
    """

    white: float
    correlated: float
    time: float
    growth: float = 0.0
    reading: float = 0.0

    @property
    def total(self) -> float:
        """sd of one reading, at no force."""
        return float(np.hypot(self.white, self.correlated))


def noise_level(loops: Loops, model: Model) -> NoiseLevel | None:
    """Posterior mode of the noise under the model's priors; None where the strokes are too short to tell.

    What a polynomial leaves of a window is noise and the muscle's own curve: the lowest degree is taken that
    differences of strokes do not contradict. A ripple of the drive is as fast as noise, but comes back in the
    next cycle; a snap does not come back, but stands out of its stroke. So where all contradict each other,
    the smaller noise is the sensor's, by the lowest degree that leaves hardly more than higher ones, and the
    rest is structure.
    """
    inside = _told([inside_strokes(loops, degree) for degree in range(DEGREE, HIGHEST + 1)], loops, model)
    across = _told([between_strokes(loops)], loops, model)
    if not inside or not across:
        told = next(iter(_believed(inside) + across), None)
        alone = whole_strokes(loops) if told is None else told.windows
        return None if alone is None else _mode([alone], loops.averaged, model)
    for one in inside:
        both = _mode([one.windows, across[0].windows], loops.averaged, model)
        if sum(_lost(told, both, loops.averaged, model) for told in (one, across[0])) <= CONTRADICTS:
            return both
    return min(_believed(inside) + across, key=lambda told: told.typical).level


class _Told(NamedTuple):
    """Windows, what they alone say of the noise, and its sd at a typical force (N)."""

    windows: Windows
    level: NoiseLevel
    typical: float


def _scale(model: Model) -> float:
    """The force (N) at which a growth of one counts."""
    assert model.setting is not None
    return model.setting.force_scale


def _told(cut: Sequence[Windows | None], loops: Loops, model: Model) -> list[_Told]:
    """What each of these windows alone says."""
    scale = _scale(model)
    every: list[_Told] = []
    for windows in cut:
        if windows is not None:
            level = _mode([windows], loops.averaged, model)
            grows = grown(np.array(level.growth), windows.force, scale)
            every.append(_Told(windows, level, level.total * float(np.mean(grows))))
    return every


def _believed(every: Sequence[_Told]) -> list[_Told]:
    """The first, by rising degree, that leaves hardly more than others do; none of none."""
    least = min((told.typical for told in every), default=0.0)
    return [told for told in every if told.typical <= LEFT * least][:1]


def _mode(seen: list[Windows], averaged: int, model: Model) -> NoiseLevel:
    """Posterior mode given what windows see."""
    names = [name for name in (WHITE, CORRELATED, TIME, GROWTH) if name in model.names]
    priors: dict[str, Prior] = {p.name: p.prior for p in model.parameters}
    scale = _scale(model)

    typical = float(priors[WHITE].from_normal(np.zeros(1))[0]) if WHITE in priors else 0.0
    readings = [0.0]
    if isinstance(lasts := priors.get(TIME), LogUniform):
        priors[TIME] = replace(lasts, low=BRIEF * lasts.low)
        if any(len(windows.paces()) > 1 for windows in seen):
            # Strokes of several paces tell whether noise lasts for a time or for some readings.
            readings.append(lasts.low / SHORTEST)

    def level(u: Array, reading: float) -> NoiseLevel:
        given = {name: float(priors[name].from_normal(u[i : i + 1])[0]) for i, name in enumerate(names)}
        if typical and CORRELATED in given:
            # A noisy cell is noisy at all its frequencies: few windows tell a share better than a size.
            given[CORRELATED] *= given[WHITE] / typical
        told = NoiseLevel(*(given.get(name, absent) for name, absent in ABSENT.items()))
        return replace(told, reading=reading)

    def negative(u: Array, reading: float) -> float:
        if np.any(np.abs(u) > 12.0):
            return 1e12
        noise = level(u, reading)
        return float(0.5 * u @ u) - sum(_log_likelihood(w, noise, averaged, scale) for w in usual)

    usual = [_paced(windows.usual(GROWTH in names)) for windows in seen]
    # Left to itself the search starts with steps of 0.00025 at zero, and ends there.
    start = np.zeros(len(names))
    simplex = np.concatenate([start[None], np.eye(len(names))])
    ends: list[tuple[float, NoiseLevel]] = []
    for reading in readings:
        end = optimize.minimize(
            negative,
            start,
            args=(reading,),
            method="Nelder-Mead",
            options={"maxiter": 600, "xatol": 1e-3, "initial_simplex": simplex},
        )
        ends.append((float(end.fun), level(end.x, reading)))
    return min(ends, key=lambda end: end[0])[1]


def _lost(told: _Told, noise: NoiseLevel, averaged: int, model: Model) -> float:
    """Nats that windows lose by another noise than their own."""
    scale = _scale(model)
    usual = _paced(told.windows.usual(GROWTH in model.names))
    own, other = (_log_likelihood(usual, n, averaged, scale) for n in (told.level, noise))
    return own - other


class _Paced(NamedTuple):
    """Windows of one pace, and what no noise changes: their scatter, and their time steps (s)."""

    windows: Windows
    scatter: FastScatter
    steps: list[float]


def _paced(windows: Windows) -> list[_Paced]:
    """Windows parted by pace, once for all the noises that they are asked about."""
    # A difference of two strokes has noise of both, each at its own pace.
    steps = [(some, np.unique(np.median(some.dt, axis=0)).tolist()) for some in windows.paces()]
    return [_Paced(some, some.scatter(own[0]), own) for some, own in steps]


def _log_likelihood(parts: list[_Paced], noise: NoiseLevel, averaged: int, scale: float) -> float:
    """Log likelihood (nats) of what usual windows see; growth is stated for the force ``scale``, N."""
    sizes = [np.array([size]) for size in (noise.white, noise.correlated, noise.time)]
    total = 0.0
    for some, scatter, steps in parts:
        seen = [replace(scatter, dt=dt) for dt in ([noise.reading] if noise.reading else steps)]
        covariance = np.mean([one.covariance(averaged, *sizes) for one in seen], axis=0)
        if noise.growth == 0.0:
            total += float(scatter.log_likelihood_of(covariance)[0])
        else:
            grows = grown(np.array([[noise.growth]]), some.force, scale)
            total += float(chunk_log_likelihood(covariance, some.chunks, grows)[0])
    return total
