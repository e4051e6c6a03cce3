"""From the searched sets to a verdict: adequate, named, ambiguous or unexplained."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mpam_calib.criticism.budget import remainder_rms, structured
from mpam_calib.criticism.bursts import bursts_rms
from mpam_calib.criticism.hum import hum_rms
from mpam_calib.criticism.load_cell import load_cell_rival
from mpam_calib.criticism.problem import SIZES
from mpam_calib.criticism.refits import Set
from mpam_calib.criticism.repeat import raw_residual, repeating_rms
from mpam_calib.criticism.search import Search
from mpam_calib.model.noise import grown

Word = Literal["adequate", "named", "ambiguous", "unexplained"]

SURE, LEAD = 0.95, 5.0
"""Probability that the named set holds, and nats by which it leads."""
STANDS = 20.0
"""The same for a cause beside structure that no set removes: odds of models that are known to be wrong."""
LISTED = 5
BESIDE = 10.0
"""Nats below the likeliest set down to which these data hardly separate others from it."""
NOISE_SIZE = 0.5
"""A remainder whose root mean square is below this share of a reading's noise is at its level."""
REPEAT_SIZE = 0.2
"""The same for fine structure that repeats, which itself passes for noise in a single stroke."""


@dataclass(frozen=True)
class Verdict:
    """The word, the leading set, and every set with its probability (best first).

    ``standing`` are the causes that hold even beside a remainder; ``size`` indexes the remainder's size
    under the leading set; ``repeating`` (N) is the fine structure that the strokes share, ``bursts`` (N) that
    of readings that stand out of their strokes, ``hum`` (N) that of one frequency in all readings;
    ``load_cell`` is by how many nats a load cell that gives way beats the leading set, where it comes near.
    """

    word: Word
    leading: Set
    standing: Set
    probabilities: dict[Set, float]
    marginals: dict[str, float]
    size: int
    repeating: float = 0.0
    bursts: float = 0.0
    hum: float = 0.0
    load_cell: float | None = None

    def others(self) -> dict[Set, float]:
        """The five likeliest sets besides the standing one, and more of those that come near, to ten."""
        others = [s for s in self.probabilities if s != self.standing]
        return {s: self.probabilities[s] for s in others[: max(LISTED, min(self.near(), 2 * LISTED))]}

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
    repeating, bursts, hum = _fine(found, leading, size)
    fine = repeating > REPEAT_SIZE * problem.noise_level.total or bursts > 0.0 or hum > 0.0
    unlessened = bool(leading) and not _lessens(found, leading)
    left = problem.saturated > 0.0 or fine or unlessened or _structure_left(found, leading, size)
    rival = load_cell_rival(found, leading) if leading or left else None
    gives_way = rival is not None and rival.lead > -LEAD
    if left or gives_way:
        standing = _standing(found, leading)
        if rival is not None and gives_way:
            standing &= rival.beside
        if not _lessens(found, standing):
            standing = frozenset()
        return Verdict(
            "unexplained", leading, standing, probabilities, marginals, size, repeating, bursts, hum,
            rival.lead if rival is not None and gives_way else None,
        )  # fmt: skip
    if not leading and probabilities[leading] > 0.5:
        return Verdict("adequate", leading, frozenset(), probabilities, marginals, size)
    lead = scores[0] - scores[1] if len(scores) > 1 else np.inf
    if leading and probabilities[leading] >= SURE and lead >= LEAD:
        return Verdict("named", leading, leading, probabilities, marginals, size)
    if not leading or (frozenset() in sets[:LISTED] and probabilities[frozenset()] > 1.0 - SURE):
        # Nothing is the likeliest, or cannot be excluded: no structure beyond the noise was shown.
        return Verdict(
            "adequate", frozenset(), frozenset(), probabilities, marginals, found.best_size(frozenset())
        )
    return Verdict("ambiguous", leading, leading, probabilities, marginals, size)


def _structure_left(found: Search, leading: Set, size: int) -> bool:
    """Whether a remainder above the noise is needed beside the leading set."""
    if size == 0:
        return False
    bare = found.fits.get((leading, 0))
    held = found.fits[leading, size]
    if bare is not None and held.log_evidence - bare.log_evidence < LEAD:
        return False
    return remainder_rms(found.problem, held) > NOISE_SIZE * found.problem.noise_level.total


def _lessens(found: Search, effects: Set) -> bool:
    """Whether the causes leave less misfit than there was, what they leave to doubts about them included.

    A cause of a huge size would otherwise be a licence to doubt it.
    """
    problem = found.problem
    after = structured(problem, found.refit(effects, 0))
    return after <= structured(problem, found.refit(frozenset(), 0))


def _fine(found: Search, leading: Set, size: int) -> tuple[float, float, float]:
    """What the leading set leaves of the raw readings (N): structure that strokes share, bursts, a hum."""
    problem = found.problem
    if problem.rows is None:
        return 0.0, 0.0, 0.0
    rows, noise = problem.rows, problem.noise_level
    residual = raw_residual(rows, problem.blueprint.model_dump_json(), found.fits[leading, size])
    grows = grown(np.array(noise.growth), rows.force, problem.force_scale)
    # Tails that were declared are no bursts.
    bursts = 0.0 if problem.blueprint.noise.robust else bursts_rms(rows, residual, grows)
    return repeating_rms(rows, residual), bursts, hum_rms(rows, residual)


def _standing(found: Search, leading: Set) -> Set:
    """Causes of the leading set that stand beside the largest remainder, sure and by a clear margin.

    A remainder that may hold anything is the fairest rival: what it can replace is no cause. Where the fit is
    worse than its noise even so, margins shrink in proportion (quasi-likelihood: McCullagh and Nelder 1989,
    chapter 9).
    """
    largest = len(SIZES) - 1
    for e in leading:
        found.refit(leading - {e}, largest)
    scores = {
        s: f.log_evidence + found.log_prior(s) for (s, size), f in found.fits.items() if size == largest
    }
    total = float(np.logaddexp.reduce(list(scores.values())))
    first = max(scores, key=lambda s: scores[s])
    worse = max(found.fits[first, largest].chi2 / len(found.problem), 1.0)
    standing = set()
    for e in leading:
        with_e = float(np.logaddexp.reduce([v for s, v in scores.items() if e in s]))
        without = max(v for s, v in scores.items() if e not in s)
        best = max(v for s, v in scores.items() if e in s)
        if np.exp(with_e - total) >= SURE and best - without >= STANDS * worse:
            standing.add(e)
    return frozenset(standing)
