"""One set's refit: climbs from several starts, other forms of its effects, a doubt about these.

These are the tasks of a search's workers, which hold the problem.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from itertools import product

import numpy as np
from scipy import linalg

from mpam_calib.criticism.fitting.climb import CONVERGED, NEARLY
from mpam_calib.criticism.fitting.doubt import DOUBTS
from mpam_calib.criticism.fitting.fit import Fit, fit
from mpam_calib.criticism.fitting.forms import equations_of, flexible, forms_of, price
from mpam_calib.criticism.tasks.spread import held_problem

Set = frozenset[str]
Try = tuple[tuple[str, ...], dict[str, float]]
"""Forms of the effects, and coordinates to start from."""

HOPELESS = 30.0
"""Nats behind, at its word, that no doubt of a form makes up for."""


def causes_of(found: Fit) -> Set:
    """The effects of a fit, whatever their forms."""
    return frozenset(named_forms(found))


def named_forms(found: Fit) -> dict[str, str]:
    """The form of each effect of a fit."""
    return {e.partition(":")[0]: e for e in sorted(found.effects)}


def bends(found: Fit) -> bool:
    """Whether an effect of a fit follows no equation, but a bent one."""
    return any(form not in equations_of(e) for e, form in named_forms(found).items())


def once_more(found: Fit) -> list[Try]:
    """One climb, in the forms of a fit and from where it ended."""
    return [(tuple(sorted(found.effects)), found.ended)]


def best_of(task: tuple[int, list[Try], bool]) -> Fit | None:
    """The best of some climbs."""
    size, tries, doubting = task
    best: Fit | None = None
    for forms, start in tries:
        best = _better(best, forms, size, start)
    return with_doubt(best) if best is not None and doubting else best


def with_doubt(found: Fit) -> Fit:
    """The fit with a doubt about the forms of its effects; as it is where that cannot be climbed."""
    again = _better(None, tuple(sorted(found.effects)), found.size, found.ended, DOUBTS)
    return found if again is None else again


def with_doubted_equations(task: tuple[Fit, bool]) -> Fit:
    """:func:`with_doubt`, where a bent effect may follow its equation instead, or (``task`` says) others'.

    At its word an equation that is a little off loses to a bend, which costs more than a doubt does.
    """
    found, others_too = task
    best = with_doubt(found)
    for e, form in named_forms(found).items():
        own, *others = equations_of(e)
        if form not in (own, *others):
            at_word = [_best_with(best, [own]), _best_with(best, others if others_too else [])]
            doubted = [with_doubt(equation) for equation in at_word if equation is not None]
            best = max([best, *doubted], key=lambda f: f.log_evidence)
    return best


def other_forms(found: Fit) -> list[str]:
    """All forms of a fit's effects that these do not have."""
    return [form for e, own in named_forms(found).items() for form in forms_of(e) if form != own]


def in_another_form(task: tuple[Fit, str]) -> Fit | None:
    """A doubted fit with one of its effects in another form, doubted as well; None where that is hopeless."""
    found, form = task
    at_word = _best_with(found, [form])
    # By a fit's first doubt, none, its equations are taken at their word.
    plain = found.under[0].log_evidence - sum(map(price, sorted(found.effects)))
    return None if at_word is None or at_word.log_evidence < plain - HOPELESS else with_doubt(at_word)


def with_two_other_equations(task: tuple[Fit, tuple[str, str]]) -> Fit | None:
    """A fit with a pair of its effects in the other equations that suit it best, at their word.

    A bend of one may hold what the other's equation lacks, and then no change of one alone leads on.
    """
    found, pair = task
    own = named_forms(found)
    best: Fit | None = None
    for forms in product(*(equations_of(e) for e in pair)):
        if all(form != own[e] for e, form in zip(pair, forms, strict=True)):
            choice = own | dict(zip(pair, forms, strict=True))
            best = _better(best, tuple(choice.values()), found.size, found.ended)
    return best


def _best_with(found: Fit, forms: list[str]) -> Fit | None:
    """The best fit in which one effect has one of these forms instead, at its word."""
    best: Fit | None = None
    for form in forms:
        best = _better(best, _with(found, form), found.size, found.ended)
    return best


def _with(found: Fit, form: str) -> tuple[str, ...]:
    """The forms of a fit, but one of its effects in another form."""
    return tuple((named_forms(found) | {form.partition(":")[0]: form}).values())


def with_better_forms(found: Fit) -> Fit:
    """The fit with its forms changed one at a time; a pair's also from the effects' own equations on.

    Of two causes that act at the same moment each may have a form that makes up for the other's, and no
    change of one alone leads on. Larger sets take over what their pairs have chosen.
    """
    best = _one_at_a_time(found, forms_of)
    others = _from_equations(best) if len(best.effects) == 2 else []
    return max([best, *others], key=lambda f: f.log_evidence)


def _from_equations(found: Fit) -> list[Fit]:
    """Fits from the own equations on, each given up once for another form, the one that helps most first."""
    start = _better(None, tuple(named_forms(found)), found.size, found.ended)
    fits = [] if start is None else [start]
    while fits:
        best = now = fits[-1]
        for e in sorted(now.effects & named_forms(now).keys()):  # still in its own equation
            for form in forms_of(e)[1:]:
                best = _better(best, _with(now, form), now.size, now.ended) or best
        if best is now:
            break
        fits.append(best)
    return fits[-1:]


def with_better_kinds(found: Fit) -> Fit:
    """The same among the forms that hold most shapes alone."""
    return _one_at_a_time(found, flexible)


def _one_at_a_time(found: Fit, choice: Callable[[str], tuple[str, ...]]) -> Fit:
    best = found
    for e in sorted(named_forms(found)):
        for form in choice(e):
            best = _better(best, _with(best, form), found.size, best.ended) or best
    return best


def _better(
    best: Fit | None,
    forms: tuple[str, ...],
    size: int,
    start: dict[str, float],
    doubts: tuple[float, ...] = (),
) -> Fit | None:
    """The better of a fit and another climb, which is given up once it shows that it will not be."""
    try:
        # On its way a climb may pass through shapes that no muscle has.
        with warnings.catch_warnings(), np.errstate(over="ignore", invalid="ignore"):
            warnings.simplefilter("ignore", linalg.LinAlgWarning)
            rival = -np.inf if best is None or doubts else best.objective
            # At its word a set is only ranked: what is reported is climbed again, with its doubts.
            found = fit(
                held_problem(),
                frozenset(forms),
                size,
                start,
                doubts=doubts,
                rival=rival,
                converged=CONVERGED if doubts else NEARLY,
            )
    except np.linalg.LinAlgError:
        return best
    found = replace(found, log_evidence=found.log_evidence - sum(map(price, sorted(forms))))
    return found if best is None or found.log_evidence > best.log_evidence else best
