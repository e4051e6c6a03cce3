"""The sensor's noise by itself: read off what is too fast for any muscle, before any model is fitted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import optimize

from mpam_calib.model.model import Model
from mpam_calib.model.noise import CORRELATED, TIME, WHITE
from mpam_calib.posterior.covariance import fast_noise_log_likelihood
from mpam_calib.specimen.recording import Loops

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

WINDOW, DEGREE = 32, 3
"""Windows of at most so many rows, detrended by a polynomial of this degree ..."""
SHORT_DEGREE = 5
"""... or of this one, where a stroke is so short that it is one window."""
FEWEST_PAIRS = 6
"""Pairs of repeated strokes that are enough to tell the noise from."""


@dataclass(frozen=True)
class NoiseLevel:
    """White and correlated sd (N) and the latter's time constant (s)."""

    white: float
    correlated: float
    time: float

    @property
    def total(self) -> float:
        """sd of one reading."""
        return float(np.hypot(self.white, self.correlated))


def noise_level(loops: Loops, model: Model) -> NoiseLevel | None:
    """Posterior mode of the noise under the model's priors; None where the strokes are too short to tell."""
    found = _windows(loops)
    if found is None:
        return None
    scatter, count, contrast, dt = found
    names = [name for name in (WHITE, CORRELATED, TIME) if name in model.names]
    priors = {p.name: p.prior for p in model.parameters}

    def values(u: Array) -> list[Array]:
        given = {name: priors[name].from_normal(u[i : i + 1]) for i, name in enumerate(names)}
        absent = {WHITE: 1.0, CORRELATED: 0.0, TIME: 1.0}
        return [given.get(name, np.array([absent[name]])) for name in absent]

    def negative(u: Array) -> float:
        if np.any(np.abs(u) > 12.0):
            return 1e12
        likelihood = fast_noise_log_likelihood((scatter, count, contrast, dt), loops.averaged, *values(u))
        return float(0.5 * u @ u - likelihood[0])

    start = np.zeros(len(names))
    end = optimize.minimize(negative, start, method="Nelder-Mead", options={"maxiter": 600, "xatol": 1e-3})
    white, correlated, time = (float(v[0]) for v in values(end.x))
    return NoiseLevel(white, correlated, time)


def _windows(loops: Loops) -> tuple[Array, int, Array, float] | None:
    """Scatter of detrended windows of consecutive rows inside strokes, away from their ends."""
    first = np.flatnonzero(np.diff(loops.stroke, prepend=loops.stroke[0] - 1))
    length = np.diff(np.append(first, len(loops.stroke)))
    typical = int(np.median(length))
    size, degree, margin = min(WINDOW, typical // 4), DEGREE, max(min(WINDOW, typical // 4) // 4, 2)
    if size < DEGREE + 4 and (found := _between_cycles(loops, first, length)) is not None:
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
    return _scatter(loops.force_N[index], degree, dt)


def _between_cycles(loops: Loops, first: Ints, length: Ints) -> tuple[Array, int, Array, float] | None:
    """The same from differences of strokes that repeat each other: short strokes leave no other way.

    What the muscle does, and whatever is wrong with it, comes back in the next cycle; noise does not.
    """
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
    return _scatter(difference, DEGREE, dt)


def _scatter(windows: Array, degree: int, dt: float) -> tuple[Array, int, Array, float]:
    """Scatter of windows (k, size) less a polynomial, how many were kept, the contrasts, time step."""
    size = windows.shape[1]
    full, _ = np.linalg.qr(np.vander(np.linspace(-1.0, 1.0, size), degree + 1), mode="complete")
    contrast = np.asarray(full[:, degree + 1 :], dtype=np.float64)
    projected = windows @ contrast
    # A burst or a snap must not pass for noise: windows far above the typical one are left out.
    power = np.mean(projected**2, axis=1)
    kept = power <= 4.0 * np.median(power)
    return projected[kept].T @ projected[kept], int(kept.sum()), contrast, max(dt, 1e-9)
