"""The measurement that would show an effect, or tell two sets of effects apart, beside what was measured."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from typing import Any, Final

import numpy as np
import pandas as pd

from mpam_calib.model.effect import effect
from mpam_calib.report.blocks import Block, DataTable, Text
from mpam_calib.specimen.recording import Specimen
from mpam_calib.units import si_factor

STOPS: Final = 0.05
"""Share of its largest blocked force below which a muscle has all but stopped pulling."""


def _tested(specimen: Specimen) -> bool:
    """Whether the bladder's tensile test is there already, with the muscle or in a run."""
    return specimen.tensile is not None or specimen.simulation.moduli.startswith("run:")


def _stopped(specimen: Specimen) -> bool:
    """Whether the blocked force is there already down to where the muscle stops pulling."""
    blocked = specimen.blocked_force
    if blocked is None:
        return False
    slack = blocked.censored | (blocked.force_N < STOPS * blocked.force_N.max(initial=0.0))
    return bool(np.any(slack))


def _static(specimen: Specimen) -> bool:
    """Whether there is no loop that could be repeated."""
    return specimen.loops is None


INSTEAD: Final[dict[str, tuple[Callable[[Specimen], bool], str]]] = {
    "order_too_low": (_tested, "the tensile test, fitted at a higher order and at the muscle's strains"),
    "dead_band": (_stopped, "more readings of the blocked force about where the muscle stops pulling"),
    "pressure_droop": (_static, "a pressure sensor at the muscle itself"),
}
"""What shows an effect where the measurement that does it usually was made already, or cannot be."""

TOO_SMALL: Final = "too small for the measurement that would tell a larger one"

STAND_IN: Final = "If one of these is there, what it does may have been put down to another cause."
"""At one level a dead-band is as good as a braid angle, and the angle alone is tested."""


def shown_by(identifier: str, specimen: Specimen) -> str:
    """The measurement that would show an effect, "" where none is known."""
    if identifier in INSTEAD:
        needed, words = INSTEAD[identifier]
        if needed(specimen):
            return words
    return effect(identifier).told_by


def too_small(identifier: str, bands: Mapping[str, Mapping[str, float]]) -> bool:
    """Whether an effect, by the bands of its parameters (printed units), is less than what would tell it."""
    least = effect(identifier).resolution
    told = [
        max(abs(bands[name]["q05"]), abs(bands[name]["q95"])) * si_factor(name) < size
        for name, size in least.items()
        if name in bands
    ]
    return bool(told) and all(told)


def telling(
    one: set[str],
    other: set[str],
    specimen: Specimen,
    marginals: Mapping[str, float],
    small: Set[str] = frozenset(),
) -> str:
    """The measurement for the likeliest effect in which two sets differ: one that either set claims.

    ``marginals`` are the effects' probabilities over all sets; ``small`` are too small to be measured.
    """
    differ = sorted((one ^ other) - small, key=lambda e: (-marginals.get(e, 0.0), e))
    none = TOO_SMALL if small & (one ^ other) else ""
    return next((words for e in differ if (words := shown_by(e, specimen))), none)


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
    table = DataTable(pd.DataFrame(rows), "Effects that these data are silent on", None)
    return [Text(STAND_IN), table] if content["verdict"] != "adequate" else [table]
