"""How alike neighbouring rows of a test are: how many of them say as much as one independent reading."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special

Array = NDArray[np.float64]

LONGEST = 0.05
"""Share of the test over which noise is correlated at most: what goes on for longer is the rubber's own."""
TIMES, SHARES = 24, 32
"""Correlation times, and shares of the noise that are correlated, that are weighed against each other."""
FINE = 60
"""Half-waves that are taken one by one; of shorter ones about as many groups suffice."""


def autocorrelation_time(left: Array) -> float:
    """Integrated autocorrelation time, at least 1, of residuals (n,).

    Geyer's initial positive sequence (1992, doi:10.1214/ss/1177011137).
    """
    n = len(left)
    padded = fft.next_fast_len(2 * n, real=True)
    covariance = fft.irfft(np.abs(fft.rfft(left, n=padded)) ** 2, n=padded)[:n]
    pairs = (covariance[: n - n % 2].reshape(-1, 2) / covariance[0]).sum(axis=1)
    kept = int(np.argmax(pairs <= 0.0)) if (pairs <= 0.0).any() else len(pairs)
    return max(2.0 * float(pairs[:kept].sum()) - 1.0, 1.0)


def hidden_time(left: Array, degree: int) -> float:
    """The same of residuals (n,) that a curve of this degree has robbed of their slowest waves.

    The curve goes along with slow noise as with the rubber, so that what it leaves looks more independent
    than the noise is. The half-waves that are too short for it tell white noise and noise with a correlation
    time apart; how strong the slow waves are follows from the two. Averaged over times and shares; 1 where
    white noise is likelier than all else.
    """
    n = len(left)
    waves = np.arange(degree + 1, n)
    longest = LONGEST * n
    if len(waves) <= degree or longest <= 1.0:
        return 1.0
    power = fft.dct(left, norm="ortho")[waves] ** 2
    wave, power, count = _grouped(waves, power)
    a = np.exp(-1.0 / np.geomspace(0.5, longest, TIMES))[:, None, None]
    share = np.sqrt(np.linspace(0.0, 1.0, SHARES))[None, :, None]
    spectrum = 1.0 - share + share * (1.0 - a**2) / (1.0 - 2.0 * a * np.cos(np.pi * wave / n) + a**2)
    # The size of the noise is integrated out, with a flat prior on its logarithm.
    size = np.sum(count * power / spectrum, axis=-1)
    fit = np.sum(count * np.log(spectrum), axis=-1) + count.sum() * np.log(size)
    prior = np.full_like(fit, 1.0 / fit[:, 1:].size)
    prior[:, 0] = 1.0 / len(fit)  # white noise is as probable as all other kinds
    weight = special.softmax(np.log(prior) - 0.5 * fit)
    if weight[:, 0].sum() >= 0.5:
        return 1.0
    time = (1.0 - share + share * (1.0 + a) / (1.0 - a))[..., 0]
    # Rows are what is averaged, not times: a few unlikely long ones would outweigh all others.
    return max(1.0 / float(np.sum(weight / time)), 1.0)


def _grouped(wave: NDArray[np.int64], power: Array) -> tuple[Array, Array, Array]:
    """Half-waves, the mean of their powers and how many each is; long ones alone, short ones in groups."""
    if len(wave) <= FINE:
        return wave.astype(np.float64), power, np.ones(len(wave))
    starts = np.unique([*range(FINE), *np.geomspace(FINE, len(wave), FINE).astype(np.int64)[:-1]])
    count = np.diff(np.append(starts, len(wave))).astype(np.float64)
    return np.add.reduceat(wave, starts) / count, np.add.reduceat(power, starts) / count, count
