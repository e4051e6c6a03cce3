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
from mpam_calib.posterior.mode import Mode

Array = NDArray[np.float64]

NEGLIGIBLE, NEGLIGIBLE_ELSEWHERE = 5.0, 8.0
"""Nats below the best size at which Laplace's figure will do; and at which other priors are not tried."""
SETTLES = 7
"""Parameters up to which the rule of quadrature settles; in more it is left at Laplace's figure."""
AS_DECLARED = (1.0, 1.0)
WIDTHS = {
    "as declared": AS_DECLARED,
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
    problem: Problem, blueprint: Blueprint, fits: list[Fit], widths: tuple[float, float] = AS_DECLARED
) -> float:
    """Log evidence, summed over the remainder's sizes; ``widths`` as in WIDTHS."""
    return float(np.logaddexp.reduce(list(_sizes(problem, blueprint, fits, widths)[0].values())))


def weigh(problem: Problem, blueprint: Blueprint, fits: list[Fit], seed: int) -> Weighed:
    """Quadrature and, for the sizes that matter, a bridge; an infinite error where none could be built."""
    terms, inner = _sizes(problem, blueprint, fits, AS_DECLARED)
    quadrature = float(np.logaddexp.reduce(list(terms.values())))
    if not inner:
        return Weighed(quadrature, Bridge(quadrature, float("inf")))
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
    terms = {f.size: f.log_evidence + log(SIZE_PRIOR[f.size]) for f in fits}
    best = max(terms.values())
    declared = widths == AS_DECLARED
    # Under other priors the fits' own evidences say only roughly which sizes matter.
    within = NEGLIGIBLE if declared else NEGLIGIBLE_ELSEWHERE
    modes: dict[int, tuple[Hypothesis, Mode]] = {}
    for found in fits:
        if terms[found.size] < best - within:
            continue
        hypothesis = Hypothesis(problem, blueprint, found, *widths)
        few = len(hypothesis.parameters) <= SETTLES
        mode = hypothesis.fitted_mode() if declared and few else hypothesis.mode()
        modes[found.size] = hypothesis, mode
        if not (declared and few):
            terms[found.size] = mode.log_evidence + log(SIZE_PRIOR[found.size])
    terms = {size: value for size, value in terms.items() if declared or size in modes}
    best = max(terms.values())
    inner: dict[int, tuple[Hypothesis, Evidence]] = {}
    for size, (hypothesis, mode) in modes.items():
        if terms[size] < best - NEGLIGIBLE or len(mode.u) > SETTLES:
            continue
        integral = integrate(hypothesis, mode)
        if integral.reliable:
            terms[size] = integral.value + log(SIZE_PRIOR[size])
            inner[size] = hypothesis, integral
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
