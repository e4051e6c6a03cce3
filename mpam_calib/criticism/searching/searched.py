"""The sets of effects that were refitted so far: fits, scores, and how one set's fit leads to another's.

A set's posterior sums its evidence over the remainder's sizes. A priori a further cause is as likely
as the average catalogue has it: a set of k out of n effects has prior ∝ RATE^k / C(n, k).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import combinations
from math import comb, log

import numpy as np

from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.fitting.forms import flexible
from mpam_calib.criticism.fitting.refits import (
    Set,
    Try,
    bends,
    best_of,
    causes_of,
    in_another_form,
    named_forms,
    once_more,
    other_forms,
    with_better_forms,
    with_better_kinds,
    with_doubt,
    with_doubted_equations,
    with_two_other_equations,
)
from mpam_calib.criticism.tasks.spread import Spread
from mpam_calib.model.bend import is_bend
from mpam_calib.model.effect import effect

RATE = 0.01
"""Prior odds of one more cause: a passenger must not come close to the set that it rides on."""
LARGEST = 3
"""Effects in the largest sets."""
WIDTH = 6
"""Sets of each size that are extended further."""
CARRIED = 60
"""Leading sets that go on once the noise is settled."""
NEAR, POLISHED = 25.0, 40
"""Nats behind the best within which sets are tried in all their forms, and how many of these at most."""
LEADERS = 5
"""Sets whose parts and forms are looked at once more."""
DOUBTED_EACH = 4
"""Best sets of every number of effects that are doubted in the end."""
IN_PAIRS = 6
"""Leading sets with bent forms (within ``NEAR``) of which two forms at a time are changed in the end."""
IN_ALL_FORMS, CLOSE = 6, 12.0
"""So many leading sets, and nats behind the best, of which all forms have their say in the end."""
TURNS = 2
"""Times that the forms are gone through, where the likeliest was another one."""
STARTS = (0.8, -0.8)
"""Further starts (prior sds) for a single effect: the force is curved in some of them."""


@dataclass
class Search:
    """All refitted sets so far: fits by (set, size index)."""

    problem: Problem
    tested: tuple[str, ...]
    spread: Spread
    fits: dict[tuple[Set, int], Fit] = field(default_factory=dict)
    polished: dict[tuple[Set, int], bool] = field(default_factory=dict)
    """Fits whose forms were changed one at a time, and whether that left them as they were."""
    doubting: bool = False
    """Whether a fit also doubts the forms of its effects: only the leading sets are worth that."""
    searched: dict[tuple[Set, int], Fit] = field(default_factory=dict)
    """All that was refitted before the doubt."""
    in_forms: dict[Set, tuple[Fit, ...]] = field(default_factory=dict)
    """Of the leading sets the doubted fit, and those with one of its effects in another form."""
    seen: frozenset[Set] = frozenset()
    """Sets that were refitted before the noise was settled."""

    def refit(self, effects: Set, size: int) -> Fit:
        """The best exact refit of a set, from where its best parts ended and from nothing.

        The search goes by bent forms, which hold most shapes; :meth:`polish` then tries the others one at
        a time, and larger sets take over what it chose. Having had a choice of forms is paid for.
        """
        key = (effects, size)
        if key not in self.fits:
            self.refit_all([key])
        if key not in self.fits:
            raise np.linalg.LinAlgError(f"no fit of {sorted(effects)}")
        return self.fits[key]

    def refit_all(self, keys: Iterable[tuple[Set, int]]) -> None:
        """Refit many sets, each beside a remainder of one size; those that no climb can fit are left out."""
        todo = [key for key in dict.fromkeys(keys) if key not in self.fits]
        tasks = [(size, self._tries(effects, size), self.doubting) for effects, size in todo]
        for key, found in zip(todo, self.spread(best_of, tasks), strict=True):
            if found is not None:
                self.fits[key] = found

    def refit_like(self, known: Fit) -> Fit | None:
        """The best refit in the forms of another fit, and from where that ended; None where no climb ends."""
        tasks = [(size, once_more(known), self.doubting) for size in range(len(SIZES))]
        fits = [f for f in self.spread(best_of, tasks) if f is not None]
        return max(fits, key=lambda f: f.log_share, default=None)

    def _tries(self, effects: Set, size: int) -> list[Try]:
        """Forms and starts of a set's climbs."""
        near = next((f for s in (size - 1, size + 1) if (f := self.fits.get((effects, s)))), None)
        if not effects:
            return [((), {})]
        if len(effects) == 1:
            names = _own_names(self.problem, effects)
            far = [dict.fromkeys(names, value) for value in STARTS if names]
            starts = [{}, *(far if near is None else [near.ended])]
            return [((form,), start) for e in effects for form in flexible(e) for start in starts]
        if near is not None:
            return once_more(near)
        # From where the best part ended, and from nothing: a part may have ended in a shape that only
        # made up for what it lacked.
        parts = self._from_parts(effects, size)
        tries = [(tuple(choice[e] for e in sorted(effects)), start) for choice, start in parts]
        tries.append((tries[0][0], {}))
        if len(effects) == 2:
            choice, _ = parts[0]
            # Alone, a cause may have taken another shape for want of its partner.
            for e in sorted(effects):
                others = [f for f in flexible(e) if f != choice[e]]
                tries += [(tuple((choice | {e: form}).values()), {}) for form in others]
        return tries

    def _from_parts(self, effects: Set, size: int) -> list[tuple[dict[str, str], dict[str, float]]]:
        """Forms and sizes of the best part of a set, and of the effect that it lacks.

        Of a pair also those that it has beside the remainder that suits it best: beside a smaller one it may
        never have come to them.
        """
        parts = [
            p for p in map(frozenset, combinations(sorted(effects), len(effects) - 1)) if self._known(p, size)
        ]
        if not parts:
            return [({e: flexible(e)[0] for e in effects}, {})]
        part = max(parts, key=self.score)
        (new,) = effects - part
        # Beside others a cause takes the shape that it has; alone, one that makes up for what it lacks.
        beside = [p for p in parts if new in p]
        other = max(beside, key=self.score) if beside else frozenset([new])
        found: list[tuple[dict[str, str], dict[str, float]]] = []
        for at in (size, self.best_size(part)) if len(part) > 1 else (size,):
            base, own = self._known(part, at), self._known(other, at)
            assert base is not None
            form = flexible(new)[0] if own is None else named_forms(own)[new]
            start = {} if own is None else {n: u for n, u in own.ended.items() if not is_bend(n)}
            choice = named_forms(base) | {new: form}
            if all(choice != seen for seen, _ in found):
                found.append((choice, start | base.ended))
        return found

    def _known(self, effects: Set, size: int) -> Fit | None:
        """The set's fit beside a remainder of this size, or of the size that suits it best."""
        if (effects, size) in self.fits:
            return self.fits[effects, size]
        return self.best_fit(effects) if self._of_all_sizes(effects) else None

    def polish_all(self, keys: Iterable[tuple[Set, int]]) -> None:
        """Change one form of a set at a time, as long as that helps."""
        todo = [k for k in dict.fromkeys(keys) if k in self.fits and k not in self.polished]
        todo.sort(key=lambda k: -len(k[0]))  # the longest first: nobody waits for one that began last
        better = dict(zip(todo, self.spread(with_better_forms, [self.fits[k] for k in todo]), strict=True))
        self.polished |= {k: f.effects == self.fits[k].effects for k, f in better.items()}
        self.fits.update(better)

    def polish(self, sets: Iterable[Set]) -> None:
        """Polish sets alone, and beside the remainder that suits each best."""
        listed = [s for s in sets if self._of_all_sizes(s)]
        self.polish_all((s, size) for s in listed for size in (0, self.best_size(s)))

    def even_out(self, sets: Iterable[Set]) -> None:
        """Refit sets beside every remainder in the forms that suit them best beside one of these."""
        leads = {s: self.best_fit(s) for s in sets}
        keys = [
            (s, size)
            for s, lead in leads.items()
            for size in range(len(SIZES))
            if (s, size) in self.fits and self.fits[s, size].effects != lead.effects
        ]
        tasks = [(size, once_more(leads[s]), self.doubting) for s, size in keys]
        for key, fit in zip(keys, self.spread(best_of, tasks), strict=True):
            if fit is not None and fit.log_evidence > self.fits[key].log_evidence:
                self.fits[key] = fit

    def swap(self, effects: Set) -> None:
        """Refit sets with another cause in the place of one; the others had the forms of poorer company."""
        found = self.best_fit(effects)
        tasks: dict[tuple[Set, int], tuple[int, list[Try], bool]] = {}
        for left in sorted(effects):
            kept = {e: form for e, form in named_forms(found).items() if e != left}
            for new in (e for e in self.tested if e not in effects):
                tries = [(tuple((kept | {new: form}).values()), found.ended) for form in flexible(new)]
                tasks[frozenset([*kept, new]), 0] = (0, tries, self.doubting)
        for key, fit in zip(tasks, self.spread(best_of, tasks.values()), strict=True):
            if fit is not None and (key not in self.fits or fit.log_evidence > self.fits[key].log_evidence):
                self.fits[key] = fit
                self.polished.pop(key, None)

    def bend_all(self, keys: Iterable[tuple[Set, int]]) -> None:
        """Change one bent form of a set at a time: its parts had theirs to make up for what they lacked."""
        todo = [k for k in keys if k in self.fits]
        self.fits.update(zip(todo, self.spread(with_better_kinds, [self.fits[k] for k in todo]), strict=True))

    def polish_near(self) -> None:
        """Polish all that may yet lead: in the bent forms of the search a true set may trail some nats."""
        sets = self.sets[:POLISHED]
        least = self.score(sets[0]) - NEAR
        self.polish_all((s, self.best_size(s)) for s in sets if self.score(s) > least)

    def doubt(self, leading: int, further: bool = True) -> None:
        """Refit so many leading sets, and the best of each number of effects, with a doubt of their forms.

        And those with one ``further`` cause, wherever they are: what could hide though nothing was found?
        """
        sets, count = self.sets, range(LARGEST + 1)
        chosen = {
            *sets[:leading],
            *(s for k in count for s in [q for q in sets if len(q) == k][:DOUBTED_EACH]),
        }
        chosen |= {frozenset(p) for s in sets[:LEADERS] for p in combinations(sorted(s), max(len(s) - 1, 0))}
        bases = [s for s in (frozenset[str](), sets[0]) if s in sets[:LEADERS]] if further else []
        chosen |= {larger for base in bases for larger in self.with_one_more(base)}
        keys = [key for key in self.fits if key[0] in chosen]
        rest = [key for key in keys if key[1] != self.best_size(key[0])]
        best = [key for key in keys if key[1] == self.best_size(key[0])]
        tasks = [(self.fits[key], key[0] in sets[:LEADERS]) for key in best]
        doubted = [
            *self.spread(with_doubted_equations, tasks),
            *self.spread(with_doubt, [self.fits[key] for key in rest]),
        ]
        # A doubt has its price in evidence: who does not pay it cannot be compared with those who do.
        self.searched, self.fits = self.fits, dict(zip([*best, *rest], doubted, strict=True))
        self.doubting = True

    def over_forms(self, further: bool = True) -> None:
        """Give the sets that may lead the evidence of all their forms.

        The likeliest alone says too little for a cause that many equations describe, and forms that were
        found one after the other need not be the likeliest. What has ``further`` causes than the first may
        be left as it is.
        """
        sets = self.sets
        least = self.score(sets[0]) - NEAR
        listed = [s for s in sets if further or not s > sets[0]]
        near = [s for s in listed if self.score(s) > least and bends(self.best_fit(s))][:IN_PAIRS]
        self.in_two_other_equations(near)
        sets = self.sets
        least = self.score(sets[0]) - CLOSE
        listed = [s for s in sets if further or not s > sets[0]]
        self.refit_in_forms([s for s in listed if self.score(s) > least][:IN_ALL_FORMS])

    def in_two_other_equations(self, sets: Iterable[Set]) -> None:
        """Give doubted sets the pair of other equations that suits each best, where that is better."""
        tasks = [(self.best_fit(s), pair) for s in sets for pair in combinations(sorted(s), 2)]
        at_word: dict[Set, Fit] = {}
        for fit in self.spread(with_two_other_equations, tasks):
            if fit is not None:
                known = at_word.setdefault(causes_of(fit), fit)
                at_word[causes_of(fit)] = max(known, fit, key=lambda f: f.log_evidence)
        for effects, fit in zip(at_word, self.spread(with_doubt, at_word.values()), strict=True):
            if fit.log_evidence > self.fits[effects, fit.size].log_evidence:
                self.fits[effects, fit.size] = fit

    def refit_in_forms(self, sets: Iterable[Set]) -> None:
        """Refit sets with one of their effects in another form, doubted; from the likeliest once more."""
        bases = {s: self.best_fit(s) for s in sets if s not in self.in_forms}
        for _turn in range(TURNS):
            tasks = [(base, form) for base in bases.values() for form in other_forms(base)]
            found = {s: [base] for s, base in bases.items()}
            for (base, _), fit in zip(tasks, self.spread(in_another_form, tasks), strict=True):
                if fit is not None:
                    found[causes_of(base)].append(fit)
            self.in_forms |= {s: tuple(fits) for s, fits in found.items()}
            likeliest = {s: max(fits, key=lambda f: f.log_evidence) for s, fits in found.items()}
            self.fits |= {(s, best.size): best for s, best in likeliest.items()}
            bases = {s: best for s, best in likeliest.items() if best is not bases[s]}

    def with_one_more(self, effects: Set) -> list[Set]:
        """The set with each further effect, as far as sets go."""
        return [effects | {e} for e in self.tested if e not in effects] if len(effects) < LARGEST else []

    def on(self, problem: Problem, spread: Spread) -> Search:
        """The leading sets refitted to the same rows with another noise, each from where it ended."""
        kept = {frozenset(), *self.sets[:CARRIED]}
        kept |= {s for k in range(1, LARGEST + 1) for s in self.kept(k, WIDTH)}
        made = Search(problem, self.tested, spread, seen=self.seen | {effects for effects, _ in self.fits})
        keys = [key for key in self.fits if key[0] in kept]
        tasks = [(f.size, once_more(f), False) for f in (self.fits[key] for key in keys)]
        for key, found in zip(keys, spread(best_of, tasks), strict=True):
            if found is not None:
                made.fits[key] = found
        return made

    def log_prior(self, effects: Set) -> float:
        """Log prior of a set (up to a constant)."""
        n, k = len(self.tested), len(effects)
        return k * log(RATE) - log(comb(n, k))

    def score(self, effects: Set) -> float:
        """Log posterior of a set (up to a constant), summed over the forms that were refitted."""
        return self.score_of_best(effects) + self._other_forms(effects)

    def _other_forms(self, effects: Set) -> float:
        """Nats that a set's other forms add to its evidence; those of each effect by themselves."""
        if effects not in self.in_forms:
            return 0.0
        base, *others = self.in_forms[effects]
        own = named_forms(base)
        terms = {e: [0.0] for e in own}
        for other in others:
            (e,) = (e for e, form in named_forms(other).items() if form != own[e])
            terms[e].append(other.log_evidence - base.log_evidence)
        every = sum(float(np.logaddexp.reduce(t)) for t in terms.values())
        return every + base.log_evidence - self.fits[effects, base.size].log_evidence

    def score_of_best(self, effects: Set) -> float:
        """The same for the likeliest forms alone, summed over the sizes that were refitted."""
        terms = [f.log_share for f in self._of_all_sizes(effects)]
        return float(np.logaddexp.reduce(terms)) + self.log_prior(effects)

    def best_size(self, effects: Set) -> int:
        """The remainder's size that carries most of a set's posterior."""
        return self.best_fit(effects).size

    def best_fit(self, effects: Set) -> Fit:
        """The refit beside the remainder that carries most of a set's posterior."""
        return max(self._of_all_sizes(effects), key=lambda f: f.log_share)

    def _of_all_sizes(self, effects: Set) -> list[Fit]:
        """A set's refits, beside the smallest remainder first."""
        return [self.fits[effects, s] for s in range(len(SIZES)) if (effects, s) in self.fits]

    def kept(self, count: int, width: int) -> list[Set]:
        """The best sets with this many effects: by posterior, and by fit alone without a remainder."""
        sets = {effects for effects, _ in self.fits if len(effects) == count}
        by_score = best_first(sets, self.score)[:width]
        return list(dict.fromkeys([*by_score, *self.best_bare(sets)[: max(width // 2, 1)]]))

    def best_bare(self, sets: Iterable[Set]) -> list[Set]:
        """Those of these sets that were refitted without a remainder, by that fit alone, best first."""
        bare = {s for s in sets if (s, 0) in self.fits}
        return best_first(bare, lambda s: self.fits[s, 0].log_evidence)

    @property
    def sets(self) -> list[Set]:
        """All sets seen, best first."""
        return best_first({key[0] for key in self.fits}, self.score)


def _own_names(problem: Problem, effects: Set) -> list[str]:
    return [p.name for e in effects for p in effect(e).parameters(problem.setting)[:1]]


def best_first(sets: set[Set], figure: Callable[[Set], float]) -> list[Set]:
    """The sets with the largest figure first, in the same order in every process where figures tie."""
    return sorted(sets, key=lambda s: (-figure(s), sorted(s)))
