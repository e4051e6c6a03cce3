"""An instrument at fault, as a rival of the causes that lead.

Near the end of its range a load cell's readings lack more and more of large forces, as if the fixture gave,
the wall were thinner or an order of the moduli missing: causes that a search names where it has no other word
for it. With a zero or a gain of its own at every level it passes for a crosshead zeroed anew, and read late
for what rubs and for what lets go after a turn. A displacement gauge with play passes for what rubs, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations, product

import numpy as np

from mpam_calib.criticism.data.problem import SIZES
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.refits import Set, Try, best_of, once_more
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.model.effect import effect

FAULT = "load_cell"
ZEROED, RESCALED, CROSSHEAD_ZEROED = "load_cell:zeroed", "load_cell:rescaled", "length_offset:rezeroed"
"""A zero or a gain for each level, tried where the leading set has a zero of the crosshead's."""
LATE, PLAY = "late_force", "gauge_play"
"""A cell that is read late and a gauge with play, tried where the leading set has what opens a loop."""
BY_DIRECTION = {"presliding", "rate_friction", "coulomb_friction", "strand_friction"}
KNEES = (0.3, 0.6, 0.85)
"""Shares of the largest reading at which a load cell begins to give way where climbs begin."""
FAR = 3.0
"""Prior sds within which these are kept."""


@dataclass(frozen=True)
class Rival:
    """The best set with an instrument's ``fault``: nats ahead of the leading set, causes beside it, fit."""

    lead: float
    beside: Set
    fault: str = FAULT
    fitted: Fit | None = None


NO_RIVAL = Rival(-np.inf, frozenset())


def instrument_rival(found: Search, leading: Set) -> Rival:
    """A fault alone, or in place of some of the leading set's causes: at least as plain as that set."""
    chosen = found.best_fit(leading).effects
    faults = [FAULT]
    if CROSSHEAD_ZEROED in chosen:
        faults += [ZEROED, RESCALED]
    if leading & BY_DIRECTION:
        faults += [LATE, PLAY]
    return max((_rival(found, leading, fault) for fault in faults), key=lambda rival: rival.lead)


def _rival(found: Search, leading: Set, fault: str) -> Rival:
    most = max(len(leading) - 1, 0)
    sets = [frozenset(c) for k in range(most + 1) for c in combinations(sorted(leading), k)]
    keys = list(product(sets, sorted({0, found.best_size(leading)})))
    fits = found.spread(best_of, [(size, _tries(found, s, size, fault), found.doubting) for s, size in keys])
    by_set: dict[Set, list[Fit]] = {}
    for (beside, _), fitted in zip(keys, fits, strict=True):
        if fitted is not None:
            by_set.setdefault(beside, []).append(fitted)
    scores = {
        s: float(np.logaddexp.reduce([f.log_share for f in fits])) + found.log_prior(s | {FAULT})
        for s, fits in by_set.items()
    }
    if not scores:
        return NO_RIVAL
    best = max(scores, key=lambda s: scores[s])
    fitted = max(by_set[best], key=lambda f: f.log_share)
    # What opens a loop beside these may be no more than how they are reckoned.
    beside = best - BY_DIRECTION if fault in (LATE, PLAY) else best
    return Rival(scores[best] - found.score_of_best(leading), beside, fault, fitted)


def _tries(found: Search, beside: Set, size: int, fault: str) -> list[Try]:
    """Climbs from where the causes beside it ended: for a cell that gives way, from several knees."""
    sizes = (size, *range(len(SIZES)))
    known = next((found.fits[beside, s] for s in sizes if (beside, s) in found.fits), None)
    [(forms, start)] = [(tuple(sorted(beside)), {})] if known is None else once_more(known)
    if fault != FAULT:
        return [((*forms, fault), start)]
    knee = next(p for p in effect(FAULT).parameters(found.problem.setting) if p.name == "cell_knee_N")
    low, high = knee.prior.from_normal(np.array([-FAR, FAR]))
    places = np.clip(np.array(KNEES) * np.max(found.problem.force), low, high)
    starts = knee.prior.to_normal(places).tolist()
    return [((*forms, fault), start | {knee.name: u, "cell_loss_N": 1.0}) for u in starts]
