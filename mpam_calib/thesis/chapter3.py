"""Chapter 3 recomputed once: every optimum that its tables, figures and text need."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.design.blocked import blocked_force, braid_loss, gaylord_force
from mpam_calib.design.optimality import Optimality, optimality
from mpam_calib.design.problem import E_BR, RATIO_LOW, case_one, case_two
from mpam_calib.design.search import Optimum, hybrid
from mpam_calib.design.sensitivity import around, of_ratio_bound
from mpam_calib.thesis.tables import table
from mpam_calib.units import DEG, KPA, MM

Array = NDArray[np.float64]

R, ALPHA = np.asarray(3.0 * MM), np.asarray(72.0 * DEG)
"""Optimal radius (m) and angle (rad): both at their upper bounds."""
PRESSURES = np.array([float(p) for p in table("3.5").rows]) * KPA
MONOFILAMENTS = (0.10 * MM, 0.11 * MM, 0.13 * MM)
"""Radii of the PET monofilaments that such sleeves are braided from, m."""
STARTS, SHORT = 100, 20
"""Random starts, and generations after which their evolutionary stage is cut short."""


def force(P_kPa: float, t_mm: float, R_mm: float = 3.0, alpha_deg: float = 72.0) -> float:
    """Eq. 3.16 in units of print, N."""
    return float(
        blocked_force(
            np.asarray(P_kPa * KPA), np.asarray(R_mm * MM), np.asarray(t_mm * MM), np.asarray(alpha_deg * DEG)
        )
    )


def loss(P_kPa: float, R_br_mm: float, n: float) -> float:
    """Braid term of Eq. 3.12 at R = 3 mm, α = 72°, N."""
    return float(braid_loss(np.asarray(P_kPa * KPA), R, ALPHA, np.asarray(R_br_mm * MM), np.asarray(n), E_BR))


def strands_that_fit() -> float:
    """Strands of one direction, of R_br = 2.5 mm, that fit round R = 3 mm at α = 72°."""
    return float(np.floor(np.pi * R / MM * np.sin(ALPHA) / 2.5))


def best_wall() -> float:
    """Closed form of Case II's wall at the active constraint on V_bl/V, mm: R(1 − √(1 − 0.4))."""
    return float(R / MM * (1.0 - np.sqrt(1.0 - RATIO_LOW)))


def best_force(P_kPa: float) -> float:
    """Closed form of Case II's optimum, N: PπR²(2√(1 − 0.4)·T − (1 − 0.4))."""
    root = np.sqrt(1.0 - RATIO_LOW)
    return float(P_kPa * KPA * np.pi * R**2 * (2.0 * root * np.tan(ALPHA) ** 2 - root**2))


@dataclass(frozen=True)
class Starts:
    """Hybrid searches of Case II from many random populations."""

    runs: int
    reached_sqp: int
    reached_ip: int
    evaluations_mean: float
    evaluations_max: int
    lowest_global: float
    highest_global: float


class Chapter3:
    """The searches of chapter 3 at 200 kPa (and at every pressure of Table 3.5), computed on demand."""

    def __init__(self, seed: int = 0, starts: int = STARTS) -> None:
        self.seed = seed
        self.n_starts = starts

    @cached_property
    def case_two(self) -> Optimum:
        """Case II at 200 kPa."""
        return hybrid(case_two(200 * KPA), self.seed)

    @cached_property
    def case_one(self) -> Optimum:
        """Case I at 200 kPa."""
        return hybrid(case_one(200 * KPA), self.seed)

    @cached_property
    def packed(self) -> Optimum:
        """Case I at 200 kPa with strands that fit."""
        return hybrid(case_one(200 * KPA, packing=True), self.seed)

    @cached_property
    def packed_monofilament(self) -> Optimum:
        """Case I at 200 kPa with strands that fit and are no thicker than a real monofilament."""
        return hybrid(case_one(200 * KPA, packing=True, strand_radius=MONOFILAMENTS[-1]), self.seed)

    @cached_property
    def by_pressure(self) -> pd.DataFrame:
        """Optima at the pressures of Table 3.5.

        Columns ``P_kPa, R_mm, t_mm, alpha_deg, case_one_N, n, case_two_N``.
        """
        rows = []
        for P in PRESSURES:
            two = hybrid(case_two(P), self.seed, ("SQP",), 15).best
            one = hybrid(case_one(P), self.seed, ("SQP",), 15).best
            rows.append(
                (P / KPA, two.x[0] / MM, two.x[1] / MM, two.x[2] / DEG, one.value, one.x[4], two.value)
            )
        names = ["P_kPa", "R_mm", "t_mm", "alpha_deg", "case_one_N", "n", "case_two_N"]
        return pd.DataFrame(rows, columns=names)

    @cached_property
    def optimality(self) -> tuple[Optimality, Optimality]:
        """First-order conditions at the optimum of Case I and of Case II."""
        one, two = self.case_one, self.case_two
        return optimality(one.problem, one.best.x), optimality(two.problem, two.best.x)

    @cached_property
    def around(self) -> pd.DataFrame:
        """Fig. 3.6 a and c: one variable ± 5 %."""
        return around(self.case_two.problem, self.case_two.best.x)

    @cached_property
    def ratio_bound(self) -> pd.DataFrame:
        """Fig. 3.6 b: the active constraint's bound ± 5 %, re-optimised."""
        return of_ratio_bound(lambda low: case_two(200 * KPA, ratio_low=low), self.case_two.best.x)

    @cached_property
    def starts(self) -> Starts:
        """A hundred hybrid searches of Case II from random populations, their global stage cut short."""
        exact = best_force(200.0)
        runs = [
            hybrid(case_two(200 * KPA), self.seed + i, generations=SHORT) for i in range(1, self.n_starts + 1)
        ]
        reached = [[abs(stage.value - exact) < 1e-5 for stage in run.stages] for run in runs]
        globals_ = [run.start.value for run in runs]
        counts = [run.evaluations for run in runs]
        return Starts(
            self.n_starts,
            sum(r[0] for r in reached),
            sum(r[1] for r in reached),
            float(np.mean(counts)),
            max(counts),
            min(globals_),
            max(globals_),
        )


def three_models(P: Array) -> pd.DataFrame:
    """Fig. 3.2: Gaylord, with thickness, also with the braid (R_br 2.5 mm, n 50); N at pressures P (Pa)."""
    t = np.asarray(best_wall() * MM)
    thick = blocked_force(P, np.asarray(R), t, np.asarray(ALPHA))
    return pd.DataFrame(
        {
            "P_kPa": P / KPA,
            "G": gaylord_force(P, R, ALPHA),
            "G+t": thick,
            "G+t+b": thick - braid_loss(P, R, ALPHA, np.asarray(2.5 * MM), np.asarray(50.0), E_BR),
        }
    )
