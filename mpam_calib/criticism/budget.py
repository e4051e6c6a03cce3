"""The misfit budget: how many newtons each cause explains, what remains, what is noise."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import factorial

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.predicted import beyond_noise
from mpam_calib.criticism.fitting.refits import Set, best_of, named_forms
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.unexplained.repeat import raw_residual

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Budget:
    """Root mean squares (N) of the structured part before and after, of the remainder, and the shares.

    The remainder is what no cause removes of the part after: 0 to all of it.
    """

    before: float
    after: float
    remainder: float
    noise: float
    shares: dict[str, float]


def structured(problem: Problem, force: Array) -> float:
    """Mean square (N²) of what a model's force (n,) leaves beyond the noise."""
    return beyond_noise(problem.force - force, np.diagonal(problem.noise))


def misfit_budget(found: Search, causes: Set) -> Budget:
    """Shapley shares of the causes, in the forms that they have, in the misfit of the declared simulation."""
    problem = found.problem
    worth: dict[Set, float] = {}
    for part, own in _at_word(found, causes).items():
        # A cause of size 0 is as good as none: no set leaves more than its parts.
        worth[part] = min([own, *(worth[part - {e}] for e in part)])
    before = worth[frozenset()]
    shares = {}
    n = len(causes)
    for e in sorted(causes):
        share = 0.0
        for part in worth:
            if e in part:
                continue
            weight = factorial(len(part)) * factorial(n - len(part) - 1) / factorial(n)
            share += weight * (worth[part] - worth[part | {e}])
        shares[e] = share / before if before > 0.0 else 0.0
    fitted = found.best_fit(causes)
    return Budget(
        before=float(np.sqrt(before)),
        after=float(np.sqrt(worth[causes])),
        # Beside a remainder the equations bend away from the data: it is no more than they leave alone.
        remainder=min(remainder_rms(problem, fitted), float(np.sqrt(worth[causes]))),
        noise=_noise(problem, fitted),
        shares=shares,
    )


def _noise(problem: Problem, fitted: Fit) -> float:
    """A reading's noise (N): no more than all that the fit leaves of the raw readings.

    What is periodic, a hum, passes for noise that lasts far longer than the windows that tell its size.
    """
    level = problem.noise_level
    if problem.rows is None or level.growth > 0.0:
        return level.total
    residual = raw_residual(problem.rows, problem.declared, fitted)
    return min(level.total, float(np.sqrt(np.mean(residual**2))))


def _at_word(found: Search, causes: Set) -> dict[Set, float]:
    """Mean square (N²) that the equations of each part of a set leave by themselves, smaller parts first."""
    found.refit_all([(causes, 0)])
    best = found.best_fit(causes)
    forms = named_forms(best)
    parts = [frozenset(p) for k in range(len(causes) + 1) for p in combinations(sorted(causes), k)]
    chosen = [tuple(forms[e] for e in sorted(part)) for part in parts]
    tries = [[(names, best.ended), (names, {})] for names in chosen]
    fits = found.spread(best_of, [(0, each, False) for each in tries])
    return {
        part: np.inf if fitted is None else structured(found.problem, fitted.force)
        for part, fitted in zip(parts, fits, strict=True)
    }


def remainder_rms(problem: Problem, fitted: Fit) -> float:
    """Root mean square (N) of the remainder's conditional mean; 0 where the fit needs none."""
    if fitted.size == 0:
        return 0.0
    size = SIZES[fitted.size] * problem.force_scale
    residual = problem.force - fitted.force - fitted.doubt
    smooth = size**2 * problem.kernel @ linalg.solve(problem.covariance(SIZES[fitted.size]), residual)
    return float(np.sqrt(np.mean(smooth**2)))
