"""Has it converged? Rank-normalised R-hat across ensembles, and the smaller of two effective sample sizes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.chains.effective import autocorrelation_time, ess_bulk, ess_tail, rhat

Array = NDArray[np.float64]

RHAT_LIMIT = 1.01
ESS_WANTED = 400.0
SHORTEST = 10
"""Steps below which a chain cannot show how long its draws hang together."""


@dataclass(frozen=True)
class Diagnostics:
    """Per parameter (d,): R-hat across ensembles, bulk and tail ESS of all draws together."""

    rhat: Array
    ess_bulk: Array
    ess_tail: Array

    @property
    def converged(self) -> bool:
        """Whether the default limits are met."""
        return self.meets(ESS_WANTED)

    @property
    def ess_min(self) -> float:
        """The smallest ESS of any parameter, bulk or tail."""
        return float(min(self.ess_bulk.min(), self.ess_tail.min()))

    def meets(self, ess_wanted: float) -> bool:
        """R-hat within its limit and both ESS at least ``ess_wanted`` for every parameter."""
        return bool(
            np.all(self.rhat <= RHAT_LIMIT)
            and np.all(self.ess_bulk >= ess_wanted)
            and np.all(self.ess_tail >= ess_wanted)
        )


def diagnose_chains(chains: Array) -> Diagnostics:
    """Diagnostics of chains (ensembles, steps, walkers, d).

    R-hat takes each ensemble as one chain: walkers of one ensemble lean on each other, so that
    R-hat over walkers would be content with all of them in a wrong mode. ESS is the smaller of
    ArviZ's with each walker a chain (time must not be interleaved) and emcee's N/τ. Of chains too short
    to tell, each ensemble counts as one draw.
    """
    E, T, W, d = chains.shape
    between, bulk, tail = np.empty(d), np.empty(d), np.empty(d)
    for i in range(d):
        x = chains[..., i]
        between[i] = rhat(x.reshape(E, T * W))
        if T < SHORTEST:
            bulk[i] = tail[i] = float(E)
            continue
        separate = np.moveaxis(x, 2, 1).reshape(E * W, T)
        total = float(E * T * W)
        # A block that is shorter than τ cannot show it; τ is at least what the ensembles show apart.
        tau = max(autocorrelation_time(x[e].T) for e in range(E))
        limit = total / max(tau, 1.0)
        bulk[i] = min(ess_bulk(separate), limit)
        tail[i] = min(ess_tail(separate), limit)
    return Diagnostics(between, bulk, tail)
