"""From the searched sets to a verdict: adequate, named, ambiguous or unexplained."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from mpam_calib.criticism.budget import remainder_rms, structured
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit, by_equations
from mpam_calib.criticism.fitting.refits import Set
from mpam_calib.criticism.searching.searched import Search
from mpam_calib.criticism.unexplained.faults import FAULTLESS, Faults, faults_of
from mpam_calib.criticism.unexplained.free_strokes import score_beside
from mpam_calib.criticism.unexplained.instrument import NO_RIVAL, Rival, instrument_rival
from mpam_calib.criticism.unexplained.structure import Structure, structure_tests

Word = Literal["adequate", "named", "ambiguous", "unexplained"]

SURE, LEAD = 0.95, 5.0
"""Probability that the named set holds, and nats by which it leads."""
STANDS = 25.0
"""The same for a cause beside structure that no set removes: odds of models that are known to be wrong."""
LISTED = 5
BESIDE = 10.0
"""Nats below the likeliest set down to which these data hardly separate others from it."""
NOISE_SIZE, ASSUMED = 0.5, 1.0
"""A remainder whose root mean square is below this share of a reading's noise is at its level, and below that
share of a noise that was only assumed."""
TRACE, TRACE_SIZE = 1e-6, 0.2
"""p-value of a test of structure from which on the likeliest set leaves something that no noise explains, and
its root mean square as a share of a reading's noise: the tests suppose that the noise is known."""


@dataclass(frozen=True)
class Verdict:
    """The word, the leading set, and every set with its probability (best first).

    ``standing`` are the causes that hold even beside a remainder; the leading set leaves the ``faults``, and
    ``left`` is whether it leaves anything that no set removes; ``instrument`` is one at fault that comes near
    that set; ``trace`` what that set's residuals still depend on; ``unseen`` are the sets with one cause more
    that the data do not exclude, unless structure is left that would pass for it.
    """

    word: Word
    leading: Set
    standing: Set
    probabilities: dict[Set, float]
    marginals: dict[str, float]
    faults: Faults = FAULTLESS
    left: bool = False
    instrument: Rival | None = None
    trace: Structure | None = None
    unseen: frozenset[Set] = frozenset()

    def others(self) -> dict[Set, float]:
        """The likeliest sets besides the standing one, best first, and among the rest the unseen."""
        others = [s for s in self.probabilities if s != self.standing]
        first = self.likeliest()
        return {s: self.probabilities[s] for i, s in enumerate(others) if i < first or s in self.unseen}

    def likeliest(self) -> int:
        """How many other sets are listed for their probability: five, more that come near, to ten."""
        among = next(iter(self.probabilities)) != self.standing  # the likeliest is listed itself
        return max(LISTED, min(self.near() + among, 2 * LISTED))

    def near(self) -> int:
        """How many sets, neither the standing one nor the likeliest, come within ``BESIDE`` nats of this."""
        likeliest = next(iter(self.probabilities))
        least = self.probabilities[likeliest] * np.exp(-BESIDE)
        return sum(p >= least for s, p in self.probabilities.items() if s not in (self.standing, likeliest))


def judge(found: Search) -> Verdict:
    """Apply the contract's rules to a search."""
    sets = found.sets
    scores = np.array([found.score(s) for s in sets])
    weights = np.exp(scores - scores.max())
    weights /= weights.sum()
    probabilities = dict(zip(sets, weights.tolist(), strict=True))
    marginals = {e: float(sum(w for s, w in probabilities.items() if e in s)) for e in found.tested}
    leading = sets[0]
    size = found.best_size(leading)
    problem = found.problem
    faults = faults_of(problem, found.fits[leading, size])
    unlessened = bool(leading) and not _lessens(found, leading)
    trace = _trace(problem, found.fits[leading, size])
    left = bool(faults) or unlessened or trace is not None or _structure_left(found, leading, size)
    # Where nothing is the likeliest, or cannot be excluded, no structure beyond the noise was shown.
    nothing = not leading or (frozenset() in sets[:LISTED] and probabilities[frozenset()] > 1.0 - SURE)
    rival = instrument_rival(found, leading) if left or not nothing else NO_RIVAL
    gives_way = rival.lead > -LEAD
    if left or gives_way:
        standing = _standing(found, leading)
        if gives_way:
            standing &= rival.beside
        standing = _outweighing(found, standing)
        held = Verdict("unexplained", leading, standing, probabilities, marginals, faults, left, trace=trace)
        return replace(held, instrument=rival) if gives_way else held
    if nothing:
        unseen = _unseen(found, frozenset())
        return Verdict("adequate", frozenset(), frozenset(), probabilities, marginals, unseen=unseen)
    lead = scores[0] - scores[1] if len(scores) > 1 else np.inf
    word: Word = "named" if probabilities[leading] >= SURE and lead >= LEAD else "ambiguous"
    unseen = _unseen(found, leading)
    return Verdict(word, leading, leading, probabilities, marginals, unseen=unseen)


def _unseen(found: Search, base: Set) -> frozenset[Set]:
    """Sets with one cause more that the data, whatever the prior odds, hardly tell from ``base``."""

    def evidence(effects: Set) -> float:
        return found.score_of_best(effects) - found.log_prior(effects)

    seen = {effects for effects, _ in found.fits}
    least = evidence(base) - BESIDE
    return frozenset(s for s in found.with_one_more(base) if s in seen and evidence(s) > least)


def _structure_left(found: Search, leading: Set, size: int) -> bool:
    """Whether a remainder above the noise is needed beside the leading set."""
    if size == 0:
        return False
    bare = found.fits.get((leading, 0))
    held = found.fits[leading, size]
    if bare is not None and held.log_evidence - bare.log_evidence < LEAD:
        return False
    share = ASSUMED if found.problem.noise_guessed else NOISE_SIZE
    return remainder_rms(found.problem, held) > share * found.problem.noise_level.total


def _trace(problem: Problem, fitted: Fit) -> Structure | None:
    """The clearest thing that a fit's residuals still depend on, if any."""
    least = TRACE_SIZE * problem.noise_level.total
    seen = [t for t in structure_tests(problem, fitted) if t.p_value < TRACE and t.size > least]
    return min(seen, key=lambda t: t.p_value, default=None)


def _lessens(found: Search, effects: Set) -> bool:
    """Whether the causes' equations leave less misfit than there was, whatever their doubts would add.

    A cause of a huge size would otherwise be a licence to doubt it.
    """
    return _left(found, effects) <= _left(found, frozenset())


def _outweighing(found: Search, effects: Set) -> Set:
    """Those of the causes without which the misfit is more than twice as large (mean squares).

    What explains less than is left beside all causes is no name to go by: it may stand in for the rest.
    """
    left = _left(found, effects)
    kept = frozenset(e for e in effects if _left(found, effects - {e}) > 2.0 * left)
    return kept if kept == effects else _outweighing(found, kept)


def _left(found: Search, effects: Set) -> float:
    """Mean square (N²) of the misfit that the causes' equations leave; infinite where no climb ends."""
    try:
        return structured(found.problem, by_equations(found.problem, found.refit(effects, 0)))
    except np.linalg.LinAlgError:
        return np.inf


def _standing(found: Search, leading: Set) -> Set:
    """Causes of the leading set that stand beside the largest remainder, sure and by a clear margin.

    A remainder that may hold anything is the fairest rival, also one in which every stroke is off in its own
    way: what it can replace is no cause. Where the fit is worse than its noise even so, margins shrink in
    proportion (quasi-likelihood: McCullagh and Nelder 1989, chapter 9).
    """
    largest = len(SIZES) - 1
    found.refit_all((leading - {e}, largest) for e in leading)
    scores = {
        s: f.log_evidence + found.log_prior(s) for (s, size), f in found.fits.items() if size == largest
    }
    total = float(np.logaddexp.reduce(list(scores.values())))
    first = max(scores, key=lambda s: scores[s])
    worse = max(found.fits[first, largest].chi2 / len(found.problem), 1.0)
    free = found.problem.with_free_strokes()
    standing = set()
    for e in leading:
        with_e = float(np.logaddexp.reduce([v for s, v in scores.items() if e in s]))
        without = max((s for s in scores if e not in s), key=lambda s: scores[s])
        best = max((s for s in scores if e in s), key=lambda s: scores[s])
        lead = scores[best] - scores[without]
        if np.exp(with_e - total) >= SURE and lead >= STANDS * worse:
            lead = score_beside(found, free, best) - score_beside(found, free, without)
            if lead >= STANDS * worse:
                standing.add(e)
    return frozenset(standing)
