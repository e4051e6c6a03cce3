"""Every effect of the catalogue in two or more forms; one of them is the textbook ("shared") form."""

from __future__ import annotations

from ..chain import Form
from . import friction_stage, history_stage, rig_stage, shape_stage, statics_stage, textbook

FORMS: dict[tuple[str, str], Form] = {
    (form.id, form.name): form
    for module in (rig_stage, shape_stage, statics_stage, friction_stage, history_stage, textbook)
    for form in module.FORMS
}
IDS: tuple[str, ...] = tuple(sorted({effect for effect, _ in FORMS}))


def form(effect: str, name: str) -> Form:
    """The form `name` of `effect`."""
    return FORMS[effect, name]


def shared_form(effect: str) -> Form:
    """The textbook form of `effect`."""
    return next(f for (i, _), f in FORMS.items() if i == effect and f.shared)


def forms_of(effect: str) -> tuple[Form, ...]:
    """All forms of `effect`."""
    return tuple(f for (i, _), f in FORMS.items() if i == effect)
