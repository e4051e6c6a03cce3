"""Which effects the data can speak of at all, and why they cannot speak of the others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.posterior.likelihood.points import KINDS

MOVING = ("coulomb_friction", "strand_friction", "presliding", "rate_friction")
HISTORY = ("stress_softening", "creep", "force_drift")
LEVELS = {"law_shape": 3, "dead_band": 2}
SPEEDS_APART = 1.3
"""Two speeds differ when one is this many times the other."""


@dataclass(frozen=True)
class Candidates:
    """Effects to search, and (id, why not) of the rest."""

    tested: tuple[str, ...]
    not_tested: tuple[tuple[str, str], ...]


def candidates(problem: Problem) -> Candidates:
    """Sort the catalogue into what these data can test and what they cannot."""
    tested, left = [], []
    for identifier in known_effects():
        why = _why_not(identifier, problem)
        if why is None:
            tested.append(identifier)
        elif why:
            left.append((identifier, why))
    return Candidates(tuple(tested), tuple(left))


def _why_not(identifier: str, problem: Problem) -> str | None:
    """None: testable. Empty: part of the simulation already. Else the reason."""
    simulation = problem.blueprint.simulation
    if identifier in simulation.effect_ids or identifier in simulation.effects_within:
        return ""
    if effect(identifier).needs_braid and problem.blueprint.braid is None:
        return "no [braid] in specimen.toml"
    readings = problem.middle()
    moving = np.abs(readings.sign) > 0
    if identifier in MOVING:
        # Presliding needs the way since a turn, which a static point does not know.
        sign = readings.sign[problem.stroke >= 0] if identifier == "presliding" else readings.sign
        if not (np.any(sign > 0) and np.any(sign < 0)):
            return "no loops with both branches"
    if identifier in (*HISTORY, "rate_friction") and not problem.has_clock:
        return f"no clock in a {KINDS[0].replace('_', ' ')}"
    if identifier == "stress_softening" and len(problem.cycles) < 2:
        return "one cycle"
    if identifier == "rate_friction":
        # The speed of a stroke: within one it changes with the position, as much else does.
        strokes = np.unique(problem.stroke[moving & (problem.stroke >= 0)])
        speed = np.array([np.median(readings.speed[problem.stroke == s]) for s in strokes])
        speed = speed[speed > 0.0]
        if not len(speed) or speed.max() < SPEEDS_APART * speed.min():
            return "one speed"
    levels = len(np.unique(problem.level))
    # A law that is no more than constant is bent by two levels already.
    constant = identifier == "law_shape" and simulation.law == "constant"
    if levels < LEVELS.get(identifier, 1) - constant:
        return f"{levels} pressure level" + ("s" if levels > 1 else "")
    if identifier in ("law_shape", "order_too_low") and simulation.law == "free":
        return "the law is free at every level" if identifier == "law_shape" else None
    return None
