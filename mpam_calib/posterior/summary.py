"""``summary.csv``: every parameter with its posterior, its prior's width and its convergence."""

from __future__ import annotations

import numpy as np
import pandas as pd

from mpam_calib.posterior.chains.convergence import RHAT_LIMIT
from mpam_calib.posterior.chains.effective import ess_bulk, ess_tail, rhat
from mpam_calib.posterior.chains.sampling import Sampling
from mpam_calib.posterior.draws import Reported

COLUMNS = [
    "parameter",
    "unit",
    "mean",
    "sd",
    "q05",
    "q50",
    "q95",
    "prior_sd",
    "rhat",
    "ess_bulk",
    "ess_tail",
]


def summarise(listed: list[Reported], names: tuple[str, ...], sampling: Sampling) -> pd.DataFrame:
    """The table, one row per reported quantity.

    A sampled parameter's R-hat and ESS are those of all its draws, the ESS at most the number of kept ones,
    which its figures are computed from; what is computed from kept draws itself (coefficients, z) is assessed
    on these, each ensemble one chain. Its ESS is at most that of the worst sampled parameter: among kept
    draws the walkers' follow each other, which hides how long each remembers.
    """
    chains = sampling.chain.shape[0]
    figures = sampling.diagnostics
    worst = [float(np.min(ess, initial=np.inf)) for ess in (figures.ess_bulk, figures.ess_tail)]
    rows = []
    for item in listed:
        x = item.draws
        if item.name in names:
            i = names.index(item.name)
            bulk, tail = (min(float(ess[i]), x.size) for ess in (figures.ess_bulk, figures.ess_tail))
            state = (figures.rhat[i], bulk, tail)
        else:
            split = x.reshape(chains, -1)
            flat = np.ptp(split) == 0.0
            state = (
                1.0 if flat else rhat(split),
                float(x.size) if flat else min(ess_bulk(split), worst[0]),
                float(x.size) if flat else min(ess_tail(split), worst[1]),
            )
        q05, q50, q95 = np.quantile(x, [0.05, 0.5, 0.95])
        rows.append([item.name, item.unit, x.mean(), x.std(ddof=1), q05, q50, q95, item.prior_sd, *state])
    return pd.DataFrame(rows, columns=COLUMNS)


def all_converged(summary: pd.DataFrame, sampling: Sampling, ess_wanted: float) -> bool:
    """Whether every row meets the limits, the derived ones included."""
    ess = summary[["ess_bulk", "ess_tail"]].to_numpy()
    return bool(
        sampling.diagnostics.meets(ess_wanted)
        and (summary["rhat"].to_numpy() <= RHAT_LIMIT).all()
        and (ess >= ess_wanted).all()
    )
