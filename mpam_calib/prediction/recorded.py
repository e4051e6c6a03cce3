"""What of a muscle was recorded that its blueprint does not tell: the branches its readings were made on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mpam_calib.model.friction import rubs
from mpam_calib.model.model import Model
from mpam_calib.specimen.recording import BRANCH_WORDS, Specimen

RECORDED = "recorded"
"""The key of ``run.json`` that keeps it, for later commands."""


@dataclass(frozen=True)
class Recorded:
    """``branches`` holds the words of the branch column for all force readings, "" for those of no branch."""

    branches: frozenset[str] = frozenset()

    @classmethod
    def of(cls, specimen: Specimen) -> Recorded:
        """What a specimen's files hold."""
        parts = [part for part in (specimen.loops, specimen.force_map) if part is not None]
        codes = {int(code) for part in parts for code in part.branch}
        return cls(frozenset(word for word, code in BRANCH_WORDS.items() if code in codes))

    @classmethod
    def kept(cls, state: Mapping[str, Any]) -> Recorded | None:
        """That of a run, by the content of its ``run.json``; None where an older version wrote it."""
        found = state.get(RECORDED)
        return None if found is None else cls(frozenset(found["branches"]))

    def as_json(self) -> dict[str, Any]:
        """As ``run.json`` keeps it."""
        return {"branches": sorted(self.branches)}

    def tells(self, branch: str, model: Model) -> bool:
        """Whether the readings tell the force on a branch ("mean": the one without friction).

        That without friction goes by their reach alone. Readings of no branch stand for both where no
        friction is declared, as all forces are the same there.
        """
        if branch == "mean" or branch in self.branches:
            return True
        return not rubs(model.blueprint.simulation) and self.branches <= {""}
