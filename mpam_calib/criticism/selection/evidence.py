"""Evidence of the leading models beyond Laplace: its next term, quadrature, annealing, bridges, other priors.

Each works on a model's fits, one for each size of the remainder, and sums over the sizes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import log
from types import MappingProxyType

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.criticism.data.problem import SIZE_PRIOR, Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.hypothesis import Hypothesis
from mpam_calib.criticism.selection.rates import Rates
from mpam_calib.criticism.selection.rates_alone import integrate_rates
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.posterior.density.hills import hills
from mpam_calib.posterior.density.mode import Density, Mode
from mpam_calib.posterior.evidence.annealed import anneal
from mpam_calib.posterior.evidence.bridge import Bridge, bridge_evidence
from mpam_calib.posterior.evidence.expansion import expand
from mpam_calib.posterior.evidence.quadrature import Evidence, integrate
from mpam_calib.posterior.evidence.refitted import integrate_refitted

Array = NDArray[np.float64]

NEGLIGIBLE, NEGLIGIBLE_ELSEWHERE = 5.0, 8.0
"""Nats below the best size at which Laplace's figure will do; and at which other priors are not tried."""
SETTLES = 7
"""Parameters up to which the rule of quadrature settles; with more a crowd of points is annealed, and rates
of each modulus's own are integrated alone."""
FEW = 4
"""Parameters up to which densities fitted to the points follow every bend."""
FURTHEST, ALIKE = 3.0, 0.01
"""Standard errors, and nats beside them, by which quadrature and bridge may differ: one can miss a hill."""
OWN_RATES = "exponential_each"
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
    """A model's log evidence (nats) by quadrature, and by a bridge; each with its standard error.

    No ``bridge`` where the parameters are too many for one.
    """

    quadrature: float
    error: float
    bridge: Bridge | None

    @property
    def difference(self) -> float:
        """Nats between the two; NaN where there is no bridge that is to be relied on."""
        if self.bridge is None or not self.bridge.reliable:
            return float("nan")
        return abs(self.bridge.value - self.quadrature)

    @property
    def agrees(self) -> bool:
        """Whether the bridge is to be relied on, and its figure within the errors of both."""
        if self.bridge is None:
            return False
        error = np.hypot(self.bridge.error, np.nan_to_num(self.error))
        return bool(self.difference <= FURTHEST * error + ALIKE)


def log_evidence_beyond_laplace(
    problem: Problem,
    blueprint: Blueprint,
    fits: list[Fit],
    worth: float = -np.inf,
    rates: Mapping[int, Rates] = MappingProxyType({}),
    seed: int = 0,
) -> tuple[float, float]:
    """Log evidence, summed over the remainder's sizes, and its standard error.

    By Laplace's expansion to its next term where that is small, by quadrature elsewhere. With many
    parameters, or rates of each modulus's own, that takes long: where the evidence at the density's own mode
    is not ``worth`` it (nats), Laplace's figure there will do. ``rates`` is what moduli free at each level
    say of the law's rates, by size of the remainder.
    """
    slow = many_parameters(fits) or blueprint.simulation.law == OWN_RATES
    worth = worth if slow else -np.inf
    terms, inner = _sizes(problem, blueprint, fits, worth=worth, rates=rates, seed=seed)
    value = _summed(terms)
    return value, _error(terms, {size: found.error for size, (_, found) in inner.items()})


def weigh(problem: Problem, blueprint: Blueprint, fits: list[Fit], seed: int) -> Weighed:
    """Quadrature and, for the sizes that matter, a bridge; an infinite error where none could be built.

    For models of at most SETTLES parameters.
    """
    terms, inner = _sizes(problem, blueprint, fits, seed=seed)
    quadrature = _summed(terms)
    own = _error(terms, {size: found.error for size, (_, found) in inner.items()})
    if not inner:
        return Weighed(quadrature, own, Bridge(quadrature, float("inf")))
    bridges = {size: bridge_evidence(density, found, seed) for size, (density, found) in inner.items()}
    error = _error(terms, {size: bridge.error for size, bridge in bridges.items()})
    terms |= {size: bridge.value + log(SIZE_PRIOR[size]) for size, bridge in bridges.items()}
    return Weighed(quadrature, own, Bridge(_summed(terms), error))


def under_other_priors(
    problem: Problem, blueprint: Blueprint, fits: list[Fit], known: float, seed: int
) -> list[float]:
    """Log evidence for each of WIDTHS; ``known`` is that under the declared ones.

    Of many parameters Laplace's approximation says how it changes, though not how large it is.
    """

    def total(widths: tuple[float, float], worth: float = -np.inf) -> float:
        terms, _ = _sizes(problem, blueprint, fits, widths, worth, seed=seed)
        return _summed(terms)

    if many_parameters(fits):
        laplace = np.array([total(widths, worth=np.inf) for widths in WIDTHS.values()])
        return list(known + laplace - laplace[list(WIDTHS.values()).index(AS_DECLARED)])
    return [known if widths == AS_DECLARED else total(widths) for widths in WIDTHS.values()]


def many_parameters(fits: list[Fit]) -> bool:
    """Whether a model has more parameters than quadrature settles for."""
    return len(fits[0].u) > SETTLES


def _summed(terms: dict[int, float]) -> float:
    """Log of the sum over the remainder's sizes, of log terms by size."""
    return float(np.logaddexp.reduce(list(terms.values())))


def _error(terms: dict[int, float], errors: dict[int, float]) -> float:
    """Error of the sum of terms, of which some have errors (none: not known)."""
    total = _summed(terms)
    parts = [float(np.exp(terms[size] - total)) * error for size, error in errors.items()]
    return float(np.linalg.norm(parts)) if parts else float("nan")


def _sizes(
    problem: Problem,
    blueprint: Blueprint,
    fits: list[Fit],
    widths: tuple[float, float] = AS_DECLARED,
    worth: float = -np.inf,
    rates: Mapping[int, Rates] = MappingProxyType({}),
    seed: int = 0,
) -> tuple[dict[int, float], dict[int, tuple[Hypothesis, Evidence]]]:
    """Terms of the sum by size, and the densities behind those that were integrated.

    ``widths`` as in WIDTHS; where Laplace's figures are not ``worth`` more (nats), they will do.
    """
    terms = {f.size: f.log_share for f in fits}
    best, laplace = max(terms.values()), _summed(terms)
    declared, many = widths == AS_DECLARED, many_parameters(fits)
    # Under other priors the fits' own evidences say only roughly which sizes matter.
    within = NEGLIGIBLE if declared else NEGLIGIBLE_ELSEWHERE
    modes: dict[int, tuple[Hypothesis, Mode]] = {}
    for found in fits:
        if terms[found.size] < best - within:
            continue
        hypothesis = Hypothesis(problem, blueprint, found, *widths)
        mode = hypothesis.mode()
        modes[found.size] = hypothesis, mode
        terms[found.size] = mode.log_evidence + log(SIZE_PRIOR[found.size])
    terms = {size: value for size, value in terms.items() if declared or size in modes}
    inner: dict[int, tuple[Hypothesis, Evidence]] = {}
    if max(laplace, _summed(terms)) < worth:
        return terms, inner
    best = -np.inf
    # The largest first: of many parameters Laplace may say several nats too much.
    for size in sorted(modes, key=lambda s: -terms[s]):
        if terms[size] < best - NEGLIGIBLE:
            break
        integral = _integral(*modes[size], rates.get(size), seed) if many else _expanded(*modes[size], seed)
        if not many and not integral.reliable:
            integral = integrate_refitted(*modes[size], seed)
        terms[size] = integral.value + log(SIZE_PRIOR[size])
        inner[size] = modes[size][0], integral
        best = max(best, terms[size])
    return terms, inner


def _expanded(density: Density, mode: Mode, seed: int) -> Evidence:
    """The evidence of a few parameters: points only where a bound is near, or the density bent or hilly."""
    expansion, few = expand(density, mode), 1 < len(mode.u) <= FEW
    if expansion.tame and not (few and len(hills(density, mode)) > 1):
        return Evidence(expansion.value, expansion.error, mode.u, mode.covariance)
    return integrate_refitted(density, mode, seed) if few else integrate(density, mode, seed)


def _integral(hypothesis: Hypothesis, mode: Mode, rates: Rates | None, seed: int) -> Evidence:
    """The evidence of a model with many parameters: most of them rates, or annealed."""
    alone = integrate_rates(rates, hypothesis, mode, seed) if rates is not None else None
    return alone or anneal(hypothesis, mode, seed)


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
