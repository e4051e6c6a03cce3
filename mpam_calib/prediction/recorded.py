"""What was recorded of a muscle that its blueprint does not tell: branches, blocked forces off the levels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.friction import rubs
from mpam_calib.model.model import Model
from mpam_calib.prediction.curves import OUTSIDE
from mpam_calib.specimen.recording import BRANCH_WORDS, Specimen
from mpam_calib.units import KPA

Array = NDArray[np.float64]

RECORDED = "recorded"
"""The key of ``run.json`` that keeps it, for later commands."""


@dataclass(frozen=True)
class Recorded:
    """``branches`` holds the words of the branch column for all force readings, "" for those of no branch.

    ``blocked_kPa`` is the least and the largest pressure at which a blocked force was read, None without any.
    """

    branches: frozenset[str] = frozenset()
    blocked_kPa: tuple[float, float] | None = None

    @classmethod
    def of(cls, specimen: Specimen) -> Recorded:
        """What a specimen's files hold."""
        parts = [part for part in (specimen.loops, specimen.force_map) if part is not None]
        codes = {int(code) for part in parts for code in part.branch}
        branches = frozenset(word for word, code in BRANCH_WORDS.items() if code in codes)
        blocked = specimen.blocked_force
        # What a load cell's floor hides is no reading of the force.
        kPa = np.zeros(0) if blocked is None else blocked.pressure_Pa[~blocked.censored] / KPA
        ends = (round(float(kPa.min()), 3), round(float(kPa.max()), 3)) if len(kPa) else None
        return cls(branches, ends)

    @classmethod
    def kept(cls, state: Mapping[str, Any]) -> Recorded | None:
        """That of a run, by the content of its ``run.json``; None where an older version wrote it."""
        found = state.get(RECORDED)
        if found is None:
            return None
        low_high = found["blocked_force_kPa"]
        return cls(frozenset(found["branches"]), None if low_high is None else tuple(low_high))

    def as_json(self) -> dict[str, Any]:
        """As ``run.json`` keeps it."""
        ends = None if self.blocked_kPa is None else list(self.blocked_kPa)
        return {"branches": sorted(self.branches), "blocked_force_kPa": ends}

    def blocked(self, pressure: Array) -> NDArray[np.bool_]:
        """Whether pressures (n,), Pa, lie among those of the blocked forces, or near their ends."""
        if self.blocked_kPa is None:
            return np.zeros(len(pressure), dtype=bool)
        low, high = self.blocked_kPa
        margin = OUTSIDE * high
        return np.asarray((pressure >= (low - margin) * KPA) & (pressure <= (high + margin) * KPA))

    def tells(self, branch: str, model: Model) -> bool:
        """Whether the readings tell the force on a branch ("mean": the one without friction).

        That without friction goes by their reach alone. Readings of no branch stand for both where no
        friction is declared, as all forces are the same there.
        """
        if branch == "mean" or branch in self.branches:
            return True
        return not rubs(model.blueprint.simulation) and self.branches <= {""}
