"""Post-optimality (thesis 3.4.5): the optimum's neighbourhood, ± 5 % one thing at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.design.problem import RATIO_LOW, Problem
from mpam_calib.design.search import refine

Array = NDArray[np.float64]

SPAN = np.linspace(0.95, 1.05, 11)
"""Factors on a variable or on the active bound."""


def around(problem: Problem, x: Array) -> pd.DataFrame:
    """Objective with one variable times 0.95 ... 1.05, the others as they are.

    Columns ``variable``, ``factor``, ``value`` (in the variable's unit of print), ``force_N``,
    ``allowed`` (whether the constraints hold; bounds are disregarded, as in the thesis).
    """
    rows = []
    for i, variable in enumerate(problem.variables):
        designs = np.tile(x, (SPAN.size, 1))
        designs[:, i] *= SPAN
        forces = problem.objective(designs)
        allowed = np.all([c.value(designs) >= -1e-9 for c in problem.constraints], axis=0)
        for factor, design, force, ok in zip(SPAN, designs, forces, allowed, strict=True):
            rows.append((variable.symbol, factor, design[i] / variable.scale, force, bool(ok)))
    return pd.DataFrame(rows, columns=["variable", "factor", "value", "force_N", "allowed"])


def of_ratio_bound(problem_at: Callable[[float], Problem], x: Array) -> pd.DataFrame:
    """Re-optimised objective with the lower bound of V_bl/V times 0.95 ... 1.05.

    ``problem_at(bound)`` builds the problem; columns ``bound``, ``force_N`` and the design in units of
    print.
    """
    rows = []
    for factor in SPAN:
        problem = problem_at(RATIO_LOW * float(factor))
        stage = refine(problem, x, "SQP")
        design = [stage.x[i] / v.scale for i, v in enumerate(problem.variables)]
        rows.append((RATIO_LOW * factor, stage.value, *design))
    names = [v.symbol for v in problem_at(RATIO_LOW).variables]
    return pd.DataFrame(rows, columns=["bound", "force_N", *names])
