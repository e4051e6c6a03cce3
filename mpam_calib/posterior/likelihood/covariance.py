"""Covariance of bin means along a stroke: white noise, correlated noise, the stroke's own remainder."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.likelihood.bins import LoopBins
from mpam_calib.posterior.likelihood.markov import Parts

Array = NDArray[np.float64]

ROUGH_LENGTH = 1.0 / 6.0
"""Correlation length of a stroke's own remainder, as a share of the stroke."""
ALIKE = 0.02
"""Strokes whose bins agree to this share (rows, lags, kernel) have one covariance."""
STEPS = 1e-8
"""Rounding by which lags and kernels may differ from those made of single steps."""


class Steps(NamedTuple):
    """How kinds of strokes go on from bin to bin, all (m, K); the last bin's steps mean nothing.

    ``within`` and ``onward``: rows from a bin's start to its end, and from there to the next one's start;
    ``kernel``: the remainder's kernel between a bin and the next; ``follows``: whether there is a next one.
    """

    within: Array
    onward: Array
    kernel: Array
    follows: NDArray[np.bool_]

    @staticmethod
    def of(lag: Array, rough: Array, seen: NDArray[np.bool_]) -> Steps | None:
        """From lags and kernels (K, m, m) and places that are seen (K, m), if they are made of steps."""
        m = seen.shape[1]
        i = np.arange(m - 1)
        within, onward, kernel = np.zeros((3, m, len(seen)))
        onward[:-1], kernel[:-1] = lag[:, i, i + 1].T, rough[:, i, i + 1].T
        within[1:-1] = lag[:, i[:-1], i[:-1] + 2].T - onward[:-2] - onward[1:-1]
        follows = np.append(seen.T[1:], np.zeros((1, len(seen)), dtype=bool), axis=0)
        within *= follows
        start = np.cumsum(np.roll(within + onward, 1, axis=0), axis=0).T
        path = np.cumsum(np.roll(np.log(np.where(follows, kernel, 1.0)), 1, axis=0), axis=0).T
        rows = start[:, None, :] - (start + within.T)[:, :, None]
        made = np.abs(rows - lag) <= STEPS * (1.0 + lag)
        made &= np.abs(np.exp(path[:, None, :] - path[:, :, None]) - rough) <= STEPS
        both = np.triu(seen[:, :, None] & seen[:, None, :], 1)
        if not np.all(made | ~both) or np.any(within < 0.0):
            return None
        return Steps(within, onward, kernel, follows)


@dataclass(frozen=True)
class StrokeCovariance:
    """Where the bins stand in a padded (segments S, width m) layout, and what their covariance is made of.

    ``index`` (S, m) is the bin at each place and ``pad`` (S, m) marks places without one. Strokes that
    are alike share a covariance, that of the first of their kind: ``kind`` (S,) numbers the kinds K.
    ``rows`` (K, m) are the rows of each bin, ``rough`` (K, m, m) the exponential kernel in displacement,
    ``lag`` (K, m, m) the rows from the end of one bin to the start of a later one, ``dt`` (K,) the time
    between rows (s), ``averaged`` how many raw rows each row stands for.
    """

    index: NDArray[np.int64]
    pad: NDArray[np.bool_]
    kind: NDArray[np.int64]
    rows: Array
    rough: Array
    lag: Array
    dt: Array
    averaged: int

    @staticmethod
    def build(bins: LoopBins) -> StrokeCovariance:
        """The layout of a set of bins."""
        index = np.full((bins.segments, bins.width), -1)
        index[bins.segment, bins.position] = np.arange(len(bins))
        pad = index < 0
        x = bins.middle().displacement[index]
        rows = np.where(pad, 1.0, bins.count[index])
        both = pad[:, :, None] | pad[:, None, :]
        distance = np.abs(x[:, :, None] - x[:, None, :]) / bins.contraction_scale
        rough = np.where(both, 0.0, np.exp(-distance / ROUGH_LENGTH))
        gap = (bins.start[index][:, None, :] - bins.stop[index][:, :, None]) / bins.dt[:, None, None]
        lag = np.where(both, 0.0, np.maximum(np.triu(gap, 1), 0.0))
        first, kind = _kinds(pad, rows, rough, lag, bins.dt)
        return StrokeCovariance(
            index, pad, kind, rows[first], rough[first], lag[first], bins.dt[first], bins.averaged
        )

    @cached_property
    def kind_pad(self) -> NDArray[np.bool_]:
        """Padding of each kind (K, m)."""
        return self.pad[[int(np.argmax(self.kind == k)) for k in range(len(self.rows))]]

    def matrix(self, white: Array, correlated: Array, time: Array, rough: Array) -> Array:
        """Covariance (B, K, m, m), N², for sds and a time constant of shape (B,); padding has variance 1.

        The correlated part is AR(1) between rows: cov of two bin means is
        σ² ρ^lag (1 − ρ^n)(1 − ρ^n′) / (n n′ (1 − ρ)²).
        """
        pad = self.kind_pad
        m = pad.shape[1]
        result = rough[:, None, None, None] ** 2 * self.rough
        diagonal = white[:, None, None] ** 2 / (self.rows * self.averaged)
        if np.any(correlated > 0.0):
            log_rho = -self.dt / time[:, None]
            mean, own = _of_means(self.rows, log_rho[:, :, None])
            cross = np.exp(self.lag * log_rho[:, :, None, None]) * mean[:, :, :, None] * mean[:, :, None, :]
            upper = np.triu(np.ones((m, m)), 1) * ~(pad[:, :, None] | pad[:, None, :])
            cross *= upper
            variance = correlated[:, None, None] ** 2
            result = result + variance[..., None] * (cross + np.swapaxes(cross, 2, 3))
            diagonal = diagonal + variance * own
        result[:, :, np.arange(m), np.arange(m)] += np.where(pad, 1.0, diagonal)
        return np.asarray(result)

    @cached_property
    def steps(self) -> Steps | None:
        """One bin after the other; None where that is not all (a way that turns back inside a stroke)."""
        return Steps.of(self.lag, self.rough, ~self.kind_pad)

    def parts(self, steps: Steps, white: Array, correlated: Array, time: Array, rough: Array) -> Parts:
        """:meth:`matrix` as its Markov parts, of batch shape (B, K)."""
        n, sds = self.rows.T[:, None], [sd[:, None] for sd in (white, correlated, rough)]
        own = sds[0] ** 2 / (n * self.averaged) + sds[2] ** 2
        found = []
        if np.any(correlated > 0.0):
            log_rho = -self.dt / time[:, None]
            mean, noise = _of_means(n, log_rho)
            own = own + sds[1] ** 2 * noise
            within, onward = (np.exp(rows[:, None] * log_rho) for rows in (steps.within, steps.onward))
            onward[:-1] *= steps.follows[:-1, None] * mean[1:] / mean[:-1]
            found.append((sds[1] ** 2 * mean**2, within, onward))
        if np.any(rough > 0.0):
            alike = np.ones_like(own)
            found.append((sds[2] ** 2 * alike, alike, steps.kernel[:, None] * alike))
        shared, within, onward = (np.stack(part, axis=1) for part in zip(*found, strict=True))
        seen = ~self.kind_pad.T[:, None]
        return Parts(np.where(seen, own, 1.0), shared * seen[:, None], within, onward)

    @cached_property
    def place(self) -> NDArray[np.int64] | slice:
        """Where each bin stands in the flattened layout (n,); all of it where no place is empty."""
        seen = np.flatnonzero(~self.pad)
        if len(seen) == self.pad.size and np.array_equal(self.index.ravel(), seen):
            return slice(None)
        result = np.empty(len(seen), dtype=np.int64)
        result[self.index.ravel()[seen]] = seen
        return result

    def rows_of(self, bins: LoopBins) -> Array:
        """Rows (n,) behind each bin, as its kind has them."""
        return np.asarray(self.rows[self.kind[bins.segment], bins.position])

    def of_each(
        self, white: Array, correlated: Array, time: Array, rough: Array, grown: Array, spread: Array
    ) -> Array:
        """Covariance (B, S, m, m) of every stroke where noise differs from bin to bin; as :meth:`matrix`.

        ``grown`` (B or 1, n) multiplies the sd of all noise of a bin, ``spread`` (B, n) the variance of its
        white part.
        """
        noise = self.matrix(white, correlated, time, np.zeros_like(rough))[:, self.kind]
        m = self.pad.shape[1]
        seen = ~self.pad
        extra = white[:, None, None] ** 2 / (self.rows * self.averaged)[self.kind]
        extra = extra * (spread[:, self.index] - 1.0)
        noise[:, :, np.arange(m), np.arange(m)] += np.where(seen, extra, 0.0)
        scale = np.where(seen, grown[:, self.index], 1.0)
        noise *= scale[:, :, :, None] * scale[:, :, None, :]
        result: Array = noise + rough[:, None, None, None] ** 2 * self.rough[self.kind]
        return result


def _kinds(
    pad: NDArray[np.bool_], rows: Array, rough: Array, lag: Array, dt: Array
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First stroke of each kind (K,), and the kind of each stroke (S,)."""
    kind = np.full(len(pad), -1, dtype=np.int64)
    first: list[int] = []
    while (left := np.flatnonzero(kind < 0)).size:
        f = left[0]  # all that are like the first stroke without a kind
        alike = np.all(pad[left] == pad[f], axis=1) & (np.abs(dt[left] / dt[f] - 1.0) <= ALIKE)
        alike &= np.all(np.abs(rows[left] - rows[f]) <= np.maximum(ALIKE * rows[f], 1.0), axis=1)
        alike &= np.all(np.abs(lag[left] - lag[f]) <= ALIKE * lag[f] + 2.0, axis=(1, 2))
        alike &= np.max(np.abs(rough[left] - rough[f]), axis=(1, 2)) <= ALIKE
        kind[left[alike]] = len(first)
        first.append(int(f))
    return np.array(first), kind


def _of_means(rows: Array, log_rho: Array) -> tuple[Array, Array]:
    """AR(1) of variance 1, means of n rows: Σ ρ^i / n over a bin's rows, and the mean's own variance."""
    rho, apart = np.exp(log_rho), -np.expm1(log_rho)  # 1 − ρ, of a stroke of one reading next to none
    series = -np.expm1(rows * log_rho) / apart
    own = (rows * (1.0 + rho) - 2.0 * rho * series) / apart / rows**2
    return series / rows, own


def lasting_share(rows: Array, dt: Array, time: Array) -> Array:
    """What means of rows (n,), ``dt`` (n,) s apart, keep of the sd of correlated noise, (B, n).

    ``time`` (B,) is its time constant, s.
    """
    _, own = _of_means(rows, -dt / time[:, None])
    return np.sqrt(own)
