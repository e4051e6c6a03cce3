"""The optimiser under a posterior: designs that maximise the mean or the 5 % quantile of blocked force."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.design.draws import MuscleDraws, mean_force, quantile_force
from mpam_calib.design.optimality import optimality
from mpam_calib.design.problem import Function, Problem, case_one, case_two
from mpam_calib.design.search import hybrid, refine, to_bounds
from mpam_calib.model.model import Model
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.curves import LIMIT
from mpam_calib.units import DEG, KPA, MM

Array = NDArray[np.float64]

SEARCHED, BANDED = 400, 2000
"""Draws behind the searches, and behind what is reported."""
GENERATIONS = 20
REFINED = 15
"""Iterations of SQP over all draws, where every step costs."""
SCANNED = tuple(0.5**k for k in range(12))
"""Shares of the way to a bound at which better designs are looked for, one variable at a time."""
METHODS = ("posterior_mean", "q05")
COLUMNS = [
    "case",
    "pressure_kPa",
    "method",
    "R_mm",
    "t_mm",
    "alpha_deg",
    "R_br_mm",
    "n",
    "blocked_force_N",
    "q05",
    "q50",
    "q95",
    "free_contraction",
    "fc_q05",
    "fc_q95",
]


@dataclass(frozen=True)
class Design:
    """One optimal design at pressure P (Pa): variables ``x`` (3 or 5,), SI, and what is expected of it.

    ``force`` (N) and ``contraction`` hold the draws, (N,); ``exact`` the force without tolerances.
    ``held_by`` names the bounds and constraints that are active.
    """

    case: str
    P: float
    method: str
    x: Array
    force: Array
    exact: Array
    contraction: Array
    held_by: tuple[str, ...]

    @property
    def without_root(self) -> float:
        """Share of draws whose force stays positive as far as is looked."""
        return float(np.mean(self.contraction >= LIMIT - 1e-9))


@dataclass(frozen=True)
class Packed:
    """Case I at P (Pa) when the strands must fit: posterior mean force (N) by upper bound of R_br (m)."""

    P: float
    free: float
    x: tuple[Array, ...]
    force: tuple[float, ...]


class Optimiser:
    """Searches over designs for one calibrated muscle."""

    def __init__(self, model: Model, draws: Draws, seed: int = 0) -> None:
        self.seed = seed
        self.few = MuscleDraws.prepare(model, draws, SEARCHED, seed)
        self.many = MuscleDraws.prepare(model, draws, BANDED, seed)
        rigid = {name: 0.0 * sd for name, sd in self.many.tolerance.items()}
        self._exact = replace(self.many, tolerance=rigid)

    def objective(self, method: str, P: float, muscle: MuscleDraws | None = None) -> Function:
        """What a method maximises at P (Pa), N, over the draws of ``muscle`` (the searches' without)."""
        chosen = muscle or self.few
        return mean_force(chosen, P) if method == "posterior_mean" else quantile_force(chosen, P)

    def at(self, P: float) -> list[Design]:
        """Both cases by both methods at P (Pa).

        Each search over few draws ends in a design; over all draws a short gradient search refines it
        and it is moved to the bounds that gain, that of the quantile also part of the way. Of all designs
        of a case a method is given the best by its own aim: none is beaten at it by the other.
        """
        two, walls = self._case(P, case_two, [])
        one, _ = self._case(P, case_one, walls)
        return [*one, *two]

    def _case(
        self, P: float, case: Callable[..., Problem], walls: list[Array]
    ) -> tuple[list[Design], list[Array]]:
        """The designs of one case, and all finalists; ``walls`` (R, t, α) are tried with its strands."""
        many = {m: case(P, objective=self.objective(m, P, self.many)) for m in METHODS}
        finalists = [self._search(case(P, objective=self.objective(m, P))) for m in METHODS]
        finalists += [np.append(wall, x[3:]) for wall in walls for x in list(finalists)]
        for method in METHODS:
            start = finalists[self._best(P, many[method], method, finalists)[0]]
            start = to_bounds(many[method], start)
            refined = refine(many[method], start, "SQP", REFINED).x
            finalists += [start, to_bounds(many[method], refined)]
        # The quantile of a number of draws has kinks, at which a gradient search stops short.
        best = finalists[self._best(P, many["q05"], "q05", finalists)[0]]
        finalists.append(to_bounds(many["q05"], best, SCANNED))
        found = []
        for method, problem in many.items():
            i, force = self._best(P, problem, method, finalists)
            found.append(self._design(problem, P, method, finalists[i], force))
        return found, finalists

    def _best(self, P: float, problem: Problem, method: str, designs: list[Array]) -> tuple[int, Array]:
        """Which of the designs a method likes best over all draws, and its force by draw (N,)."""
        forces = self.many.blocked_forces(P, np.stack(designs))
        aim = forces.mean(axis=-1) if method == METHODS[0] else np.quantile(forces, 0.05, axis=-1)
        allowed = [problem.feasible(x, 1e-6) for x in designs]
        i = int(np.argmax(np.where(allowed, aim, -np.inf)))
        return i, forces[i]

    def packed(self, P: float, radii: Sequence[float]) -> Packed:
        """Case I by the posterior mean with the packing constraint, for upper bounds of R_br (m)."""
        objective = self.objective("posterior_mean", P)
        free = self._search(case_one(P, objective=objective))
        designs = [
            self._search(case_one(P, packing=True, strand_radius=radius, objective=objective))
            for radius in radii
        ]
        means = self.many.blocked_forces(P, np.stack([free, *designs])).mean(axis=-1)
        return Packed(P, float(means[0]), tuple(designs), tuple(float(m) for m in means[1:]))

    def _search(self, problem: Problem) -> Array:
        return hybrid(problem, self.seed, ("SQP",), GENERATIONS).best.x

    def _design(self, problem: Problem, P: float, method: str, x: Array, force: Array) -> Design:
        active = optimality(problem, x).active
        return Design(
            case=problem.name.removeprefix("Case "),
            P=P,
            method=method,
            x=x,
            force=force,
            exact=self._exact.blocked_forces(P, x),
            contraction=self.many.free_contractions(P, x),
            held_by=tuple(a.name for a in active if a.multiplier > 0.0),
        )


def designs_table(designs: Sequence[Design]) -> pd.DataFrame:
    """The table ``designs.csv``; R_br and n are empty where they are not designed (Case II)."""
    rows = []
    for d in designs:
        strands = (d.x[3] / MM, d.x[4]) if len(d.x) == 5 else (np.nan, np.nan)
        force = np.quantile(d.force, [0.05, 0.5, 0.95])
        ends = np.quantile(d.contraction, [0.05, 0.95])
        geometry = (d.x[0] / MM, d.x[1] / MM, d.x[2] / DEG)
        bands = (d.force.mean(), *force, d.contraction.mean(), *ends)
        rows.append((d.case, d.P / KPA, d.method, *geometry, *strands, *bands))
    table = pd.DataFrame(rows, columns=COLUMNS).sort_values(["case", "pressure_kPa"], kind="stable")
    return table.reset_index(drop=True)
