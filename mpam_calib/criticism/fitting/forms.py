"""The forms in which a search tries an effect: as it is written, as others write it, bent."""

from __future__ import annotations

from math import log

from mpam_calib.model.effect import effect

FORM_SHARES = (0.5, 0.47, 0.03)
"""Prior shares of an effect's forms: its equation as it is written, other equations for it, bent ones. A
rival that must bend in all its parts is not to come close to causes that follow an equation. Of the causes
of five rigs that others wrote a tenth bent, but as a share it let more rivals come near than truths."""


def flexible(identifier: str) -> tuple[str, ...]:
    """The forms that hold most shapes of an effect: a bent one of every kind, and what no bend stands for."""
    item = effect(identifier)
    return tuple(f"{identifier}:{form}" for form in (*item.bent_forms, *item.apart)) or (identifier,)


def forms_of(identifier: str) -> tuple[str, ...]:
    """The effect's id as it is, and with each of its other forms."""
    return (identifier, *(f"{identifier}:{form}" for form in effect(identifier).all_forms))


def equations_of(identifier: str) -> tuple[str, ...]:
    """The forms of an effect that are not bent."""
    bent = {f"{identifier}:{form}" for form in effect(identifier).bent_forms}
    return tuple(form for form in forms_of(identifier) if form not in bent)


def price(form: str) -> float:
    """Nats that one form costs: its share of the prior among the effect's forms."""
    identifier, _, name = form.partition(":")
    item = effect(identifier)
    counts = (1, len(item.forms), len(item.bent_forms))
    kind = 2 if name in item.bent_forms else 1 if name else 0
    total = sum(share for share, count in zip(FORM_SHARES, counts, strict=True) if count)
    return log(total * counts[kind] / FORM_SHARES[kind])
