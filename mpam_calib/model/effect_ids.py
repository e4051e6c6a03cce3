"""The ids of the effects, as a specimen file writes them: the one list that everything checks against."""

from __future__ import annotations

from typing import Final

EFFECT_IDS: Final[tuple[str, ...]] = (
    "dead_band",
    "tip_shape",
    "braid_kinematics",
    "braid_angle",
    "braid_stretch",
    "wall_pressure",
    "length_offset",
    "strand_friction",
    "coulomb_friction",
    "rate_friction",
    "presliding",
    "stress_softening",
    "creep",
    "force_drift",
    "pressure_droop",
    "rig_compliance",
    "law_shape",
    "order_too_low",
)
"""Ids of the effects that ship with the package."""

_added: list[str] = []


def add_effect_id(effect_id: str) -> None:
    """Let specimen files declare ``effect_id`` too: for an effect that is registered from outside."""
    if effect_id not in known_effect_ids():
        _added.append(effect_id)


def known_effect_ids() -> tuple[str, ...]:
    """Every id that ``[simulation] effects`` may hold now: those of the package, then those added."""
    return (*EFFECT_IDS, *_added)
