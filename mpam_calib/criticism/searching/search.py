"""Searching sets of effects: linearised scores order the search, exact refits decide it.

Then the best set says how small the noise is (:mod:`mpam_calib.criticism.fitting.noise_scale`), and in
the end the leading sets are refitted with a doubt about their forms
(:mod:`mpam_calib.criticism.fitting.doubt`), and the first of them in all their forms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import combinations

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.noise_scale import noise_scale
from mpam_calib.criticism.searching.screen import partners, promising
from mpam_calib.criticism.searching.searched import LARGEST, LEADERS, WIDTH, Search
from mpam_calib.criticism.tasks.journal import Journal, journalled
from mpam_calib.criticism.tasks.spread import Alone

LEADING_SHARE = 3
"""One in so many of the sets that are extended is extended by every effect."""
PARTNERS = 4
"""Best single effects that are tried as partners of every kept set."""
SCREENED, BENT = 80, 20
"""Further sets of three that straight lines along the pairs promise most of; so many of them are bent."""
MUCH_LESS = 0.8
"""Scale of the noise down to which forms that were tried before, and stayed, need not be tried again."""
FEW_CARRIED = 2
"""Kept sets of each size whose forms a fold chooses before it extends them."""
DOUBTED = 4
"""Leading sets for each that is extended, doubted in the end."""


@contextmanager
def open_search(
    problem: Problem,
    tested: tuple[str, ...],
    listener: Callable[[float], None] | None = None,
    width: int = WIDTH,
    workers: int = 1,
    settle: bool = True,
    journal: Journal | None = None,
) -> Iterator[Search]:
    """Search sets of up to three effects, the remainder always in play; the workers stay for what is asked.

    Singles are refitted for every size of the remainder; kept sets are extended by the most promising
    partners, refitted exactly, and pruned again. Then the best set says how small the noise is, unless that
    is not to ``settle`` any more, and the leading sets are refitted. ``listener`` is told the share done;
    what is in the ``journal`` is not done again.
    """
    tell = listener or (lambda share: None)
    before: Search | None = None
    if settle:
        with journalled(problem, workers, journal) as spread:
            before = Search(problem, tested, spread)
            _grow(before, width, tell)
        best = before.sets[0]
        fits = [f for (effects, _), f in before.fits.items() if effects == best]
        # Never up: what is left beyond the noise may be a cause that the best set still lacks.
        scale = min(noise_scale(problem, fits), 1.0)
        problem = problem.with_noise_scale(scale)
    with journalled(problem, workers, journal) as spread:
        if before is None:
            found = Search(problem, tested, spread)
            _grow(found, width, tell)
        else:
            found = before.on(problem, spread)
            if scale > MUCH_LESS:
                found.polished = {k: True for k, stayed in before.polished.items() if stayed}
        _finish(found, width, tell)
        try:
            yield found
        finally:
            found.spread = Alone(problem)


def _grow(found: Search, width: int, tell: Callable[[float], None]) -> None:
    """Singles, and kept sets extended by one effect after the other."""
    tested, every = found.tested, range(len(SIZES))
    singles = [frozenset([identifier]) for identifier in tested]
    for size in every:  # beside one remainder after the other: a fit starts where its neighbour ended
        found.refit_all((s, size) for s in [frozenset(), *singles])
        tell(0.05 * (size + 1))
    kept = found.kept(1, width)
    # What larger sets take over; folds carry on what leads.
    carried = None if width >= WIDTH else FEW_CARRIED
    found.polish(kept[:carried])
    best = [next(iter(s)) for s in found.kept(1, PARTNERS)][:PARTNERS]
    for k in range(2, LARGEST + 1):
        if k == 2 and width >= WIDTH:
            # Small causes show only beside each other: all pairs are worth a look.
            found.refit_all((frozenset(pair), 0) for pair in combinations(tested, 2))
        tell(0.2 if k == 2 else 0.6)
        tries = {
            s | {p}
            for s in kept
            for p in partners(found.problem, found.fits, tested, s, found.best_size(s), best)
        }
        # A straight line along what a cause does alone may miss what it does beside others.
        tries |= {s | {p} for s in kept[: width // LEADING_SHARE] for p in tested if p not in s}
        for size in (0, 1):
            found.refit_all((effects, size) for effects in sorted(tries, key=sorted))
        if k == LARGEST and width >= WIDTH:
            # A kept set may hold a stand-in for two causes, whose own pairs all trail behind it.
            _screen(found, k)
        tell(0.4 if k == 2 else 0.75)
        kept = found.kept(k, width)
        for size in every:
            found.refit_all((effects, size) for effects in kept)
        if k < LARGEST:
            found.polish(kept[:carried])
    found.polish_near()


def _screen(found: Search, count: int) -> None:
    """Sets of so many effects that lines along smaller ones promise most of, wherever these were ranked."""
    promised = promising(found.problem, found.fits, found.tested, count - 1)
    new = [s for s in promised if (s, 0) not in found.fits][:SCREENED]
    found.refit_all((effects, 0) for effects in new)
    found.bend_all((effects, 0) for effects in found.best_bare(new)[:BENT])


def _finish(found: Search, width: int, tell: Callable[[float], None]) -> None:
    """The leaders' neighbours and parts, and a doubt about the forms of all that lead."""
    found.polish_near()
    swapped: Fit | None = None
    for turn in range(2):
        tell(0.85 + 0.07 * turn)
        # One cause of the best set may stand in for another that no kept set led to.
        if (best := found.best_fit(found.sets[0])) is not swapped:
            found.swap(found.sets[0])
            swapped = best
        found.polish_near()
        # A leader's own parts must have been looked at, or it could hide a passenger.
        leaders = found.sets[: min(LEADERS, width)]
        parts = [frozenset(p) for s in leaders for p in combinations(sorted(s), max(len(s) - 1, 0))]
        for size in range(len(SIZES)):
            found.refit_all((effects, size) for effects in [*parts, *leaders])
        # In folds it is the first that counts.
        looked_at = [*parts, *leaders] if width >= WIDTH else [*parts[: len(leaders[0])], leaders[0]]
        found.polish(looked_at)
        found.even_out(looked_at)
    first = found.sets[0]
    found.refit_all(
        (further, size) for further in found.with_one_more(first) for size in {0, found.best_size(first)}
    )
    found.doubt(DOUBTED * width, further=width >= WIDTH)
    found.over_forms(further=width >= WIDTH)
