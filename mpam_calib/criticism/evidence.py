"""Evidence of the leading models beyond Laplace: quadrature, bridge sampling, other prior widths.

Each works on a model's fits, one for each size of the remainder, and sums over the sizes.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import log

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.criticism.fit import Fit
from mpam_calib.criticism.hypothesis import Hypothesis
from mpam_calib.criticism.problem import SIZE_PRIOR, Problem
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.posterior.bridge import Bridge, bridge_evidence
from mpam_calib.posterior.evidence import Evidence, integrate

Array = NDArray[np.float64]

NEGLIGIBLE = 7.0
"""Nats below the best size at which Laplace's figure will do."""
WIDTHS = {
    "as declared": (1.0, 1.0),
    "moduli halved": (0.5, 1.0),
    "moduli doubled": (2.0, 1.0),
    "others halved": (1.0, 0.5),
    "others doubled": (1.0, 2.0),
}
"""Factors on the prior sd of the moduli (newtons) and of every other parameter."""


@dataclass(frozen=True)
class Weighed:
    """A model's log evidence (nats) by quadrature, and by a bridge with its standard error."""

    quadrature: float
    bridge: Bridge


def log_evidence_by_quadrature(
    problem: Problem, blueprint: Blueprint, fits: list[Fit], widths: tuple[float, float] = (1.0, 1.0)
) -> float:
    """Log evidence, summed over the remainder's sizes; ``widths`` as in WIDTHS."""
    return float(np.logaddexp.reduce(list(_sizes(problem, blueprint, fits, widths)[0].values())))


def weigh(problem: Problem, blueprint: Blueprint, fits: list[Fit], seed: int) -> Weighed:
    """Quadrature and, for the sizes that matter, a bridge."""
    terms, inner = _sizes(problem, blueprint, fits, (1.0, 1.0))
    quadrature = float(np.logaddexp.reduce(list(terms.values())))
    bridged, variance = dict(terms), 0.0
    for size, (hypothesis, found) in inner.items():
        value, error = bridge_evidence(hypothesis, found, seed)
        bridged[size] = value + log(SIZE_PRIOR[size])
        variance += (float(np.exp(terms[size] - quadrature)) * error) ** 2
    value = float(np.logaddexp.reduce(list(bridged.values())))
    return Weighed(quadrature, Bridge(value, float(np.sqrt(variance))))


def _sizes(
    problem: Problem, blueprint: Blueprint, fits: list[Fit], widths: tuple[float, float]
) -> tuple[dict[int, float], dict[int, tuple[Hypothesis, Evidence]]]:
    """Terms of the sum by size, and the densities behind those that were integrated."""
    declared = widths == WIDTHS["as declared"]
    all_of = {f.size: Hypothesis(problem, blueprint, f, *widths) for f in fits}
    # Under other priors the fits' own evidences do not say which sizes matter.
    modes = {} if declared else {size: hypothesis.mode() for size, hypothesis in all_of.items()}
    laplace = {f.size: f.log_evidence if declared else modes[f.size].log_evidence for f in fits}
    terms = {size: value + log(SIZE_PRIOR[size]) for size, value in laplace.items()}
    best = max(terms.values())
    inner: dict[int, tuple[Hypothesis, Evidence]] = {}
    for size, hypothesis in all_of.items():
        if terms[size] < best - NEGLIGIBLE:
            continue
        found = integrate(hypothesis, modes[size] if size in modes else hypothesis.mode())
        if np.isfinite(found.value):
            terms[size] = found.value + log(SIZE_PRIOR[size])
            inner[size] = hypothesis, found
    return terms, inner


def prior_sensitivity(evidence: Array) -> pd.DataFrame:
    """Log evidences (models, widths) as a table: one row per model and width, shares among these models.

    Columns: ``model`` (rank, from 1), ``prior``, ``log_evidence`` (nats), ``probability``.
    """
    share = np.exp(evidence - evidence.max(axis=0, keepdims=True))
    share = share / share.sum(axis=0, keepdims=True)
    rows = [
        [model + 1, name, float(evidence[model, j]), float(share[model, j])]
        for model in range(len(evidence))
        for j, name in enumerate(WIDTHS)
    ]
    return pd.DataFrame(rows, columns=["model", "prior", "log_evidence", "probability"])
