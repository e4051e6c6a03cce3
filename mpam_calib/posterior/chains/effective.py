"""Rank-normalised R-hat and effective sample sizes: ArviZ's figures without the seconds its import takes;
and the effective share of weighted draws.

Vehtari, Gelman, Simpson, Carpenter and Bürkner 2021 (doi:10.1214/20-BA1221); Sokal's window as in emcee.
Chains are arrays (chains, draws). Ranks are taken over all draws.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special, stats

Array = NDArray[np.float64]

WINDOW = 5.0
"""Sokal's window in units of τ."""
TAILS = (0.05, 0.95)


def rhat(chains: Array) -> float:
    """The larger of R-hat of the ranks and of the ranks of the distances from the median."""
    folded = np.abs(chains - np.median(chains))
    return max(_rhat(_split(_normal_scores(x))) for x in (chains, folded))


def ess_bulk(chains: Array) -> float:
    """Effective draws for the bulk."""
    return _ess(_split(_normal_scores(chains)))


def ess_tail(chains: Array) -> float:
    """Effective draws for the 5 % and 95 % quantiles, the smaller."""
    return min(_ess(_split((chains <= q).astype(np.float64))) for q in np.quantile(chains, TAILS))


def autocorrelation_time(chains: Array) -> float:
    """emcee's τ: autocorrelations averaged over chains, summed up to a window of five τ.

    A chain that never moved counts as one draw.
    """
    moved = np.ptp(chains, axis=1) > 0.0
    share = float(moved.mean())
    n = chains.shape[1]
    if not moved.any():
        return float(n)
    power, variance = _power(chains[moved])
    rho = fft.irfft((power / variance[:, None]).mean(axis=0))[:n] / n
    sums = 2.0 * np.cumsum(rho) - 1.0
    outside = np.arange(n) >= WINDOW * sums
    tau = float(sums[np.argmax(outside)] if outside.any() else sums[-1])
    return float(share * tau + (1.0 - share) * n)


def _split(chains: Array) -> Array:
    half = chains.shape[1] // 2
    return np.concatenate([chains[:, :half], chains[:, -half:]])


def _normal_scores(x: Array) -> Array:
    rank = stats.rankdata(x).reshape(x.shape)
    return np.asarray(special.ndtri((rank - 0.375) / (x.size + 0.25)))


def _rhat(chains: Array) -> float:
    n = chains.shape[1]
    between = n * np.var(chains.mean(axis=1), ddof=1)
    within = np.var(chains, axis=1, ddof=1).mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        return float(np.sqrt((between / within + n - 1.0) / n))


def _power(chains: Array) -> tuple[Array, Array]:
    """Power spectra of the padded, centred chains, and the chains' variances."""
    n = chains.shape[1]
    spectrum = fft.rfft(chains - chains.mean(axis=1, keepdims=True), n=2 * fft.next_fast_len(n), axis=1)
    return np.abs(spectrum) ** 2, np.var(chains, axis=1)


def _ess(chains: Array) -> float:
    """Geyer's initial monotone sequence of the chains' common autocorrelation."""
    if np.ptp(chains) < np.finfo(float).resolution:
        return float(chains.size)
    n = chains.shape[1]
    covariance = fft.irfft(_power(chains)[0].mean(axis=0))[:n] / n
    within = covariance[0] * n / (n - 1.0)
    total = covariance[0] + np.var(chains.mean(axis=1), ddof=1)
    rho = 1.0 - (within - covariance) / total
    rho[0] = 1.0
    # Sums of neighbours (0, 1), (2, 3), ... as long as they are positive, then made to fall.
    most = max((n - 3) // 2, 0)
    pairs = rho[0 : 2 * most + 2 : 2] + rho[1 : 2 * most + 2 : 2]
    kept = int(np.argmax(pairs < 0.0)) if (pairs < 0.0).any() else most
    falling = np.minimum.accumulate(pairs[:kept])
    last = max(float(rho[2 * kept]), 0.0)
    tau = max(-1.0 + 2.0 * falling.sum() + last, 1.0 / np.log10(chains.size))
    return float(chains.size / tau)


def effective_share(log_weight: Array) -> float:
    """Effective share of draws with these weights (Kish)."""
    return float(1.0 / np.sum(special.softmax(log_weight) ** 2) / len(log_weight))
