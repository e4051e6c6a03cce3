"""The ids of the effects, as a specimen file writes them: the one list that everything checks against."""

from __future__ import annotations

from importlib.metadata import entry_points
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

EFFECT_FORMS: Final[dict[str, tuple[str, ...]]] = {
    **dict.fromkeys(EFFECT_IDS, ("bent",)),
    "dead_band": ("bent", "soft", "power", "closing", "balloon"),
    "tip_shape": ("bent", "working", "power", "round", "tapered", "easing", "volume"),
    "braid_kinematics": ("bent", "swell", "thickness", "thin", "section"),
    "braid_angle": ("bent", "seating"),
    "braid_stretch": ("bent", "longer-bent", "power", "longer", "both"),
    "wall_pressure": ("bent", "thick", "pressed", "seated"),
    "length_offset": ("bent", "scale", "line", "slip", "settling", "bedding", "seating", "rezeroed"),
    "strand_friction": ("bent", "power", "even", "pivoting", "contact", "surface", "tension"),
    "coulomb_friction": ("bent", "constant", "capstan", "power"),
    "rate_friction": (
        *("bent", "viscous", "viscous-bent", "power", "stribeck", "drag"),
        *("stroke", "stroke-power", "stroke-drag"),
    ),
    "presliding": (
        *("bent", "rest", "rest-bent", "once", "once-bent", "masing", "masing-bent"),
        *("sliding", "sliding-bent", "ramp", "ramp-bent", "power"),
        *("dahl", "rest-dahl", "once-dahl", "masing-dahl", "sliding-dahl"),
        *("wen", "rest-wen", "once-wen"),
    ),
    "stress_softening": (
        *("bent", "force", "force-bent", "test", "test-bent", "test-force", "test-force-bent"),
        *("power", "force-power", "test-power", "test-force-power"),
        *("virgin", "virgin-fading", "force-fading", "fresh", "path", "test-virgin", "test-force-virgin"),
        *("recovering", "force-recovering", "growing", "force-growing", "worn", "test-worn"),
    ),
    "creep": (
        *("bent", "wall", "wall-bent", "early", "power", "solid", "stretched", "steps"),
        *("wall-early", "wall-power", "wall-solid", "wall-stretched", "wall-steps"),
    ),
    "force_drift": (
        *("bent", "settling", "settling-bent", "tared", "tared-bent"),
        *("early", "power", "root", "thermal", "return", "swing"),
    ),
    "pressure_droop": (
        *("bent", "level", "level-bent", "power", "level-power", "square"),
        *("saturating", "loss", "speed", "lagging", "play", "throttle", "volume", "reservoir", "refill"),
    ),
    "rig_compliance": ("bent", "power", "toe", "preload"),
    "law_shape": ("bent", "exponential", "power", "line"),
    "order_too_low": ("bent", "line", "steady", "steady-bent", "fung", "fitted", "gent"),
}
"""Other forms of the effects, declared as ``id:form``."""

OUTSIDE: Final = "mpam_calib.effects"
"""Entry-point group under which another package names a module that registers effects on import."""

_added: dict[str, tuple[str, ...]] = {}
_asked: list[str] = []


def add_effect_id(effect_id: str, forms: tuple[str, ...] = ()) -> None:
    """Let specimen files declare ``effect_id`` and its forms: for an effect registered from outside."""
    if effect_id not in EFFECT_IDS:
        _added.setdefault(effect_id, forms)


def forms_of_id(effect_id: str) -> tuple[str, ...]:
    """The forms in which ``effect_id`` may be declared besides its own."""
    return EFFECT_FORMS.get(effect_id) or _added.get(effect_id, ())


def load_outside_effects() -> None:
    """Import, once, the modules that installed packages name under ``OUTSIDE``."""
    if not _asked:
        _asked.append(OUTSIDE)
        for point in entry_points(group=OUTSIDE):
            point.load()


def known_effect_ids() -> tuple[str, ...]:
    """Every id that ``[simulation] effects`` may hold now: those of the package, then those added."""
    load_outside_effects()
    return (*EFFECT_IDS, *_added)
