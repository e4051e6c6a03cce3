"""The measurement that would show an effect, or tell two sets of effects apart, beside what was measured."""

from __future__ import annotations

from typing import Any, Final

import pandas as pd

from mpam_calib.model.effect import effect
from mpam_calib.report.blocks import Block, DataTable, Text
from mpam_calib.specimen.recording import Specimen

TESTED: Final = {"order_too_low": "the tensile test, fitted at a higher order and at the muscle's strains"}
"""What shows an effect where the bladder's tensile test is there already, with the muscle or in a run."""


def shown_by(identifier: str, specimen: Specimen) -> str:
    """The measurement that would show an effect, "" where none is known."""
    tested = specimen.tensile is not None or specimen.simulation.moduli.startswith("run:")
    if tested and identifier in TESTED:
        return TESTED[identifier]
    return effect(identifier).told_by


def telling(one: set[str], other: set[str], specimen: Specimen) -> str:
    """The measurement for the first effect in which two sets differ: one that either set claims."""
    found = (shown_by(e, specimen) for e in [*sorted(one - other), *sorted(other - one)])
    return next((words for words in found if words), "")


def not_tested(content: dict[str, Any], specimen: Specimen) -> list[Block]:
    """Effects that these data are silent on, and what would speak of each."""
    if not content["not_tested"]:
        return [Text("Every effect of the catalogue could be tested.")]
    rows = [
        {
            "effect": effect(n["id"]).title,
            "why not": n["why"],
            "what would show it": shown_by(n["id"], specimen),
        }
        for n in content["not_tested"]
    ]
    return [DataTable(pd.DataFrame(rows), "Effects that these data are silent on", None)]
