"""A load cell that gives way near the end of its range, as a rival of the causes that lead.

Its readings lack more and more of large forces, as if the fixture gave, the wall were thinner or an order of
the moduli missing: causes that a search names where it has no other word for it.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import log

import numpy as np

from mpam_calib.criticism.problem import SIZE_PRIOR, SIZES
from mpam_calib.criticism.refits import Set, Try, best_of, ended
from mpam_calib.criticism.search import Search
from mpam_calib.model.effect import effect

FAULT = "load_cell"
KNEES = (0.3, 0.6, 0.85)
"""Shares of the largest reading at which a load cell begins to give way where climbs begin."""
FAR = 3.0
"""Prior sds within which these are kept."""


@dataclass(frozen=True)
class Rival:
    """The best set with the load cell's fault: nats by which it leads the leading set, causes beside it."""

    lead: float
    beside: Set


NO_RIVAL = Rival(-np.inf, frozenset())


def load_cell_rival(found: Search, leading: Set) -> Rival:
    """The fault alone, or in place of some of the leading set's causes: at least as plain as that set."""
    most = max(len(leading) - 1, 0)
    sets = [frozenset(c) for k in range(most + 1) for c in combinations(sorted(leading), k)]
    sizes = sorted({0, found.best_size(leading)})
    tasks = [(size, _tries(found, beside, size), found.doubting) for beside in sets for size in sizes]
    fits = list(found.spread(best_of, tasks))
    scores = {}
    for i, beside in enumerate(sets):
        terms = [
            f.log_evidence + log(SIZE_PRIOR[f.size]) for f in fits[i * len(sizes) : (i + 1) * len(sizes)] if f
        ]
        if terms:
            scores[beside] = float(np.logaddexp.reduce(terms)) + found.log_prior(beside | {FAULT})
    if not scores:
        return NO_RIVAL
    best = max(scores, key=lambda s: scores[s])
    return Rival(scores[best] - found.score(leading), best)


def _tries(found: Search, beside: Set, size: int) -> list[Try]:
    """Climbs from where the causes beside it ended, for several knees."""
    sizes = (size, *range(len(SIZES)))
    known = next((found.fits[beside, s] for s in sizes if (beside, s) in found.fits), None)
    forms, start = (
        (tuple(sorted(beside)), {}) if known is None else (tuple(sorted(known.effects)), ended(known))
    )
    setting = found.problem.model.setting
    assert setting is not None
    knee = next(p for p in effect(FAULT).parameters(setting) if p.name == "cell_knee_N")
    low, high = knee.prior.from_normal(np.array([-FAR, FAR]))
    places = np.clip(np.array(KNEES) * np.max(found.problem.force), low, high)
    starts = knee.prior.to_normal(places).tolist()
    return [((*forms, FAULT), start | {knee.name: u, "cell_loss_N": 1.0}) for u in starts]
