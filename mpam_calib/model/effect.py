"""An effect: one thing that a real muscle or rig does and a simulation may leave out.

An effect is a value: an id, the stage of the chain where it acts, what it is in words, its
parameters with normalised priors, and a pure function on the chain's state. A model holds a set of
them; nothing else in the package knows any effect by name.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from importlib import import_module

import numpy as np
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.model.bend import DRIVERS, FORM, bend_factor, bend_parameters
from mpam_calib.model.priors import Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.specimen.arguments import is_number
from mpam_calib.specimen.effect_ids import add_effect_id, load_outside_effects

Array = NDArray[np.float64]
Parameters = Callable[[Setting], tuple[Parameter, ...]]
"""An effect's parameters for a setting."""
Values = Mapping[str, Array]
"""Parameter values by name, SI units, shape (B, 1)."""
Apply = Callable[[State, Values, Setting], State]
"""What an effect makes of the chain's state."""
Share = Callable[[State, Values, Setting], Array]
"""How much of an effect there is at each reading, (B or 1, n): in what the forms of one differ."""


class Stage(IntEnum):
    """The stages of the chain, in the order in which a reading passes them."""

    RIG = 1
    SHAPE = 2
    STATICS = 3
    FRICTION = 4
    HISTORY = 5
    SENSOR = 6


@dataclass(frozen=True)
class Effect:
    """One effect (see the module's docstring).

    ``sentence`` is for a rig engineer; ``source`` names the equation's origin; ``told_by`` the measurement
    that would show it by itself, ``resolution`` the least size (SI, by the parameter's name) that this
    tells in a usual lab; ``parameters`` gives the priors for a setting; ``apply`` returns the changed
    state. ``forms`` are other shapes of the same thing with the same parameters, declared as ``id:form``.
    ``uses_force`` is set where it needs the muscle's own force (a fixture that gives way), which the chain
    then finds by fixed point. ``needs_braid`` is set where it needs the declared strands, ``comes_last``
    where it acts on what the others of its stage add up to. Without ``memory`` it looks at pressure, place,
    direction, level and force alone, not at what was before. ``bends`` names the drivers (and degrees) along
    which its parameters may vary, all alike, in the form ``id:bent``
    (:mod:`mpam_calib.model.bend`), ``looseness`` how many times as far as usual, and ``kinds`` those of its
    forms that differ from it in kind and may bend too (``id:form-bent``), with a few words for each. Bends
    multiply a size; where it may come back to nothing and pass it, they are ``added`` in units of its prior
    sd. A bent effect without parameters reads its size under its own id.

    Other authors' equations are forms, too: ``own`` are the parameters that a form has beside the effect's,
    or in place of those of the same name (such forms do not bend), ``leading`` how many of the effect's it
    makes use of, where not of all, ``recalls`` the forms that have a memory and ``by_force`` those that need
    the force, though the effect does not, ``apart`` those that no bend stands for, and ``sources`` where the
    forms' equations are from. A ``fault`` of an instrument is no cause to be searched, named or declared, but
    a rival of all causes. What is ``of_test``, the tested specimen's own or its rig's, no other design has.
    """

    id: str
    stage: Stage
    title: str
    sentence: str
    source: str
    parameters: Parameters
    apply: Apply
    forms: Mapping[str, Apply] = field(default_factory=dict)
    told_by: str = ""
    resolution: Mapping[str, float] = field(default_factory=dict)
    uses_force: bool = False
    needs_braid: bool = False
    comes_last: bool = False
    memory: bool = True
    bends: Mapping[str, int] = field(default_factory=dict)
    looseness: float = 1.0
    added: bool = False
    kinds: Mapping[str, str] = field(default_factory=dict)
    own: Mapping[str, Parameters] = field(default_factory=dict)
    leading: Mapping[str, int] = field(default_factory=dict)
    recalls: tuple[str, ...] = ()
    by_force: tuple[str, ...] = ()
    apart: tuple[str, ...] = ()
    sources: Mapping[str, str] = field(default_factory=dict)
    fault: bool = False
    of_test: bool = False

    def __reduce__(self) -> tuple[Callable[[str], Effect], tuple[str]]:
        """Another process looks the effect up: what it does need not be sendable."""
        return effect, (self.id,)

    @property
    def bent_forms(self) -> tuple[str, ...]:
        """The forms that bend, one of every kind."""
        return (FORM, *(f"{kind}-{FORM}" for kind in self.kinds)) if self.bends else ()

    @property
    def all_forms(self) -> tuple[str, ...]:
        """Every form besides its own."""
        return (*self.forms, *self.bent_forms)


_REGISTRY: dict[str, Effect] = {}
_ID = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")


class NoEffect(InputError, ValueError):
    """What cannot be registered as an effect, and why."""


def register(effect: Effect) -> Effect:
    """Make an effect known under its id, to specimen files too.

    Raises ``InputError`` (a ``ValueError`` as well) where the id is taken, and for what cannot be one.
    """
    _demand_effect(effect)
    if effect.id in _REGISTRY:
        found = f"the id {effect.id!r}, which is registered already"
        raise NoEffect("register", found, "an id of its own", None, "id")
    _REGISTRY[effect.id] = effect
    if not effect.fault:
        add_effect_id(effect.id, effect.all_forms)
    return effect


def _demand_effect(given: object) -> None:
    """Raise ``NoEffect`` for what would fail later, in a specimen file or inside a fit."""

    def demand(holds: bool, column: str, found: object, expected: str) -> None:
        if not holds:
            raise NoEffect("register", repr(found)[:60], expected, None, column)

    if not isinstance(given, Effect):
        raise NoEffect("register", repr(given)[:60], "an Effect")
    words = "a word of letters, digits and underscores, as specimen files write it"
    for name in (given.id, *given.forms):
        named = isinstance(name, str) and _ID.fullmatch(name) is not None
        demand(named, "id" if name == given.id else "forms", name, words)
    demand(isinstance(given.stage, Stage), "stage", given.stage, "a Stage, such as Stage.SENSOR")
    functions = {"parameters": given.parameters, "apply": given.apply, **given.forms, **given.own}
    for name, function in functions.items():
        demand(callable(function), name, function, "a function")
    loose = is_number(given.looseness) and 0.0 < given.looseness < np.inf
    demand(loose, "looseness", given.looseness, "a number above 0")
    for name, size in given.resolution.items():
        demand(is_number(size) and 0.0 < size < np.inf, "resolution", {name: size}, "a size above 0")
    for driver, degree in given.bends.items():
        demand(driver in DRIVERS, "bends", driver, f"one of {', '.join(DRIVERS)}")
        whole = isinstance(degree, int) and not isinstance(degree, bool) and degree > 0
        demand(whole, "bends", degree, "a whole number from 1 upwards")


def effect(identifier: str) -> Effect:
    """The effect with this id, or this id and form (``id:form``); raises KeyError where there is none."""
    _load_catalogue()
    base, _, form = identifier.partition(":")
    found = _REGISTRY[base]
    if not form:
        return found
    plain = form.removesuffix(FORM).removesuffix("-")
    if plain:
        found = formed(found, plain)
    return replace(found if plain == form else bent(found), id=identifier)


def formed(item: Effect, form: str) -> Effect:
    """The effect in one of its ``forms``, with the parameters and the source that the form has of its own."""

    def parameters(setting: Setting) -> tuple[Parameter, ...]:
        own = {p.name: p for p in (item.own[form](setting) if form in item.own else ())}
        shared = {p.name: p for p in item.parameters(setting)[: item.leading.get(form)]}
        return tuple((shared | own).values())

    return replace(
        item,
        parameters=parameters,
        apply=item.forms[form],
        memory=item.memory or form in item.recalls,
        uses_force=item.uses_force or form in item.by_force,
        source=item.sources.get(form, item.source),
    )


def bent(item: Effect) -> Effect:
    """The effect with sizes that vary smoothly along its drivers, all of them alike."""

    def parameters(setting: Setting) -> tuple[Parameter, ...]:
        own = item.parameters(setting)
        name = own[0].name if own else item.id
        return (*own, *bend_parameters(name, item.bends, item.looseness, constant=not own))

    last: list[tuple[Setting, tuple[Parameter, ...]]] = []

    def own_of(setting: Setting) -> tuple[Parameter, ...]:
        # A climb asks for those of one setting many times.
        if not last or last[0][0] is not setting:
            last[:] = [(setting, item.parameters(setting))]
        return last[0][1]

    def apply(state: State, values: Values, setting: Setting) -> State:
        own = own_of(setting)
        sizes = {p.name: values[p.name] for p in own} or {item.id: np.ones((1, 1))}
        factor = bend_factor(next(iter(sizes)), item.bends, values, state, setting)
        if item.added:
            bent_sizes = {p.name: sizes[p.name] + p.prior.sd * (factor - 1.0) for p in own}
        else:
            bent_sizes = {name: size * factor for name, size in sizes.items()}
        return item.apply(state, {**values, **bent_sizes}, setting)

    by_force = item.uses_force or "force" in item.bends
    return replace(item, parameters=parameters, apply=apply, memory=True, uses_force=by_force)


def known_effects() -> tuple[str, ...]:
    """The ids of all registered effects but faults, in the order of the chain."""
    _load_catalogue()
    causes = (i for i, item in _REGISTRY.items() if not item.fault)
    return tuple(sorted(causes, key=lambda i: (_REGISTRY[i].stage, i)))


def _load_catalogue() -> None:
    import_module("mpam_calib.model.catalogue")
    load_outside_effects()
