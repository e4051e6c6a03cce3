"""Effects hidden in synthetic recordings: which may be, how large, and whether the recording shows them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.effect import effect, known_effects
from mpam_calib.model.friction import rubs
from mpam_calib.model.model import Model, build_model
from mpam_calib.model.noise import CORRELATED, WHITE
from mpam_calib.model.readings import Readings
from mpam_calib.specimen.arguments import is_number
from mpam_calib.specimen.recording import Specimen
from mpam_calib.units import si_factor

Array = NDArray[np.float64]

PLACE = "--hide"
OF_FRICTION = {"presliding", "rate_friction"}
"""Effects that only change a friction."""
TYPICAL = 1.0
"""Standard normal image of a hidden effect's default size: a large but ordinary draw of its prior."""
FARTHEST = 6.0
"""Standard normal image of the largest size that may be hidden, and less this of the smallest."""
SEEN = 0.3
"""Root of the sum of squares of all changes, in sds of the noise, below which nobody can tell an effect."""


def checked_sizes(hide: object) -> Mapping[str, float | None]:
    """What is to be hidden, where it is ids with sizes."""
    expected = 'effect ids with sizes, such as {"dead_band": 7.5}, None for a typical one'
    if not isinstance(hide, Mapping | None):
        raise InputError(PLACE, f"{type(hide).__name__} {str(hide)[:40]}", expected)
    for name, size in (hide or {}).items():
        if not isinstance(name, str) or not (size is None or is_number(size)):
            raise InputError(PLACE, f"{name}={size!r}", expected)
    return hide or {}


def with_hidden(
    blueprint: Blueprint, values: dict[str, Array], hide: Mapping[str, float | None], specimen: Specimen
) -> tuple[Model, dict[str, dict[str, float]]]:
    """The model with the hidden effects, their sizes put among the values."""
    hidden: dict[str, dict[str, float]] = {}
    for declared, size in hide.items():
        identifier, _, form = declared.partition(":")
        if identifier not in known_effects():
            raise InputError(PLACE, f'"{identifier}"', "one of " + ", ".join(known_effects()))
        forms = effect(identifier).forms
        if declared != identifier and form not in forms:
            known = "one of " + ", ".join(f"{identifier}:{f}" for f in forms) if forms else identifier
            raise InputError(PLACE, f'"{declared}"', known)
        item = effect(declared)
        if item.needs_braid and specimen.braid is None:
            raise InputError(PLACE, f"{identifier} without [braid]", "the strands' values in specimen.toml")
        if any(identifier == other.partition(":")[0] for other in hidden):
            raise InputError(PLACE, f"{identifier} twice", "each effect once")
        simulation = blueprint.simulation
        if identifier in simulation.effect_ids or identifier in simulation.effects_within:
            raise InputError(PLACE, f'"{identifier}"', "an effect that the simulation does not have")
        extended = simulation.model_copy(update={"effects": (*simulation.effects, declared)})
        blueprint = blueprint.model_copy(update={"simulation": extended})
        setting = blueprint.setting()
        assert setting is not None
        parameters = item.parameters(setting)
        shared = {p.name for p in effect(identifier).parameters(setting)}
        sizes = [p.name for p in parameters if p.name in shared]
        if size is not None and len(sizes) != 1:
            raise InputError(PLACE, f"{declared}={size:g}", f"no value: {declared} has no single size")
        hidden[declared] = {}
        for parameter in parameters:
            factor = si_factor(parameter.name)
            smallest, typical, largest = (
                float(parameter.prior.from_normal(np.array(z))) for z in (-FARTHEST, TYPICAL, FARTHEST)
            )
            value = typical if size is None or parameter.name not in sizes else size * factor
            if not smallest <= value <= largest:
                bounds = f"between {smallest / factor:.3g} and {largest / factor:.3g}"
                expected = f"{bounds} {parameter.printed_unit}".strip()
                raise InputError(PLACE, f"{declared}={size:g}", expected)
            if parameter.name in values:
                raise InputError(PLACE, f'"{identifier}"', f"an effect without the declared {parameter.name}")
            values[parameter.name] = np.full((1, 1), value)
            hidden[declared][parameter.name] = value / factor
    for identifier in sorted(OF_FRICTION & {declared.partition(":")[0] for declared in hidden}):
        if not rubs(blueprint.simulation):
            raise InputError(PLACE, f"{identifier} without friction", "a friction that it can change")
    return build_model(blueprint), hidden


def not_shown(
    model: Model,
    values: dict[str, Array],
    eta: Array,
    rows: list[Readings],
    hide: Mapping[str, float | None],
    floor: float | None,
) -> tuple[str, ...]:
    """The hidden effects without which nobody could tell the forces at the rows from what they are.

    Each by itself, beside the others; a force below the ``floor`` (N) is not read.
    """

    def recorded(simulated: Model) -> Array:
        assert simulated.chain is not None
        force = np.concatenate([simulated.chain.force(values, eta, each)[0] for each in rows])
        return force if floor is None else np.maximum(force, floor)

    noise = float(np.hypot(values[WHITE], values.get(CORRELATED, 0.0))[0, 0])
    simulation = model.blueprint.simulation
    unseen = []
    for declared in hide:
        others = tuple(each for each in simulation.effects if each != declared)
        rest = simulation.model_copy(update={"effects": others})
        without = build_model(model.blueprint.model_copy(update={"simulation": rest}))
        if float(np.linalg.norm(recorded(model) - recorded(without))) < SEEN * noise:
            unseen.append(declared)
    return tuple(unseen)
