"""The sets of cases: DEVELOP and PRACTICE to work with, LOCKED to be scored.

DEVELOP and LOCKED share no seed, no family of muscles, no outside structure and no "other" form of an effect;
only the textbook ("shared") forms occur in both. PRACTICE has develop's muscles and the curves of
`effects.textbook`, which neither has. Everything is drawn from `random.Random`, whose stream is the same on
every machine; `digest` pins the declaration.
"""

from __future__ import annotations

import hashlib
import json
import random
from dataclasses import asdict, dataclass, replace
from functools import cache
from typing import Any

from .effects import IDS, forms_of, shared_form, textbook
from .recipes import Recipe, Wanted

HISTORY_AND_RIG = (
    "stress_softening",
    "creep",
    "force_drift",
    "rate_friction",
    "presliding",
    "rig_compliance",
    "pressure_droop",
    "length_offset",
)
STATIC = (
    "tip_shape",
    "wall_pressure",
    "law_shape",
    "order_too_low",
    "braid_angle",
    "dead_band",
    "braid_stretch",
)


@dataclass(frozen=True)
class Half:
    """What one of the two sets may use."""

    name: str
    seed: int
    families: tuple[str, ...]
    other: dict[str, tuple[str, ...]]
    outside: tuple[str, ...]
    counts: dict[str, int]


DEVELOP_HALF = Half(
    "develop",
    4101,
    ("pencil", "thumb", "stub"),
    {
        "dead_band": ("softplus",),
        "pressure_droop": ("quadratic",),
        "length_offset": ("settling",),
        "rig_compliance": ("toe",),
        "tip_shape": ("cosine",),
        "braid_kinematics": ("centreline",),
        "braid_angle": ("two_families",),
        "braid_stretch": ("crimped",),
        "wall_pressure": ("thinning",),
        "law_shape": ("saturating", "knee"),
        "order_too_low": ("second_next",),
        "strand_friction": ("flat",),
        "coulomb_friction": ("drag",),
        "rate_friction": ("viscous",),
        "presliding": ("tanh",),
        "stress_softening": ("first_only", "contraction"),
        "creep": ("power", "two_times"),
        "force_drift": ("thermal",),
    },
    ("bump", "ripple", "pressure_kink", "bursts", "clip", "floor_clip"),
    {"null": 24, "separable": 42, "inseparable": 14, "outside": 14},
)

LOCKED_HALF = Half(
    "locked",
    90210,
    ("needle", "arm", "finger"),
    {
        "dead_band": ("closing_gap",),
        "pressure_droop": ("cosine", "root"),
        "length_offset": ("scale",),
        "rig_compliance": ("hertz", "progressive"),
        "tip_shape": ("elliptic", "conical"),
        "braid_kinematics": ("packed",),
        "braid_angle": ("bedding",),
        "braid_stretch": ("balance",),
        "wall_pressure": ("lame", "seating"),
        "law_shape": ("power", "sigmoid"),
        "order_too_low": ("exponential", "gent"),
        "strand_friction": ("plastic", "soft"),
        "coulomb_friction": ("sublinear", "pressure_bound"),
        "rate_friction": ("power", "stribeck"),
        "presliding": ("dahl", "slip", "lugre"),
        "stress_softening": ("power", "travel"),
        "creep": ("stretched", "standard_solid"),
        "force_drift": ("late", "wander"),
    },
    ("notch", "gear", "stick_slip", "snag", "dropouts", "hum", "jump", "compress", "quantisation"),
    {"null": 66, "separable": 120, "inseparable": 40, "outside": 40},
)

PRACTICE_HALF = replace(
    DEVELOP_HALF,
    name="practice",
    seed=777,
    other={
        i: tuple(f.name for f in forms_of(i) if f in textbook.FORMS) or (shared_form(i).name,) for i in IDS
    },
    counts={"separable": 60},
)
"""Develop's muscles with the curves that other authors would as soon have written."""


def _wanted(half: Half, rng: random.Random, effect: str, low: float, high: float) -> Wanted:
    """A form, a size uniform in its logarithm, and a sign."""
    name = shared_form(effect).name if rng.random() < 0.5 else rng.choice(half.other[effect])
    multiple = low * (high / low) ** rng.random()
    return Wanted(effect, name, float(f"{multiple:.3g}"), rng.choice((-1, 1)))


def _base(half: Half, rng: random.Random, group: str, design: str, index: int, **fields: Any) -> Recipe:
    made: dict[str, Any] = {
        "name": f"{half.name}-{group}-{index:03d}",
        # The last six digits are the set's own, so that the two sets never share a seed.
        "seed": half.seed * 1000 % 1_000_000 + rng.getrandbits(20) * 1_000_000,
        "group": group,
        "design": design,
        "family": rng.choice(half.families),
        "moduli": "tensile",
        "levels": rng.choice((5, 6, 7)),
        "cycles": 3,
        "speeds": rng.choice((1, 2)),
        "rows_max": rng.choice((1000, 1500, 2000, 3000)),
        "order": rng.choice((1, 2, 3)),
        "motion": rng.choice(("triangle", "triangle", "sine")),
        "dwell": rng.random() < 0.25,
        "columns": rng.random() < 0.7,
    }
    return Recipe(**(made | fields))


def _suited(effects: tuple[Wanted, ...], rng: random.Random) -> dict[str, Any]:
    """What must be declared so that these effects can be hidden and seen."""
    ids = {w.id for w in effects}
    fields: dict[str, Any] = {}
    if "coulomb_friction" in ids:
        fields["friction"] = rng.choice(("strand", "none"))
    elif "strand_friction" in ids:
        fields["friction"] = rng.choice(("coulomb", "coulomb", "none"))
    if ids & {"rate_friction", "presliding"} and fields.get("friction") == "none":
        fields["friction"] = "strand" if "coulomb_friction" in ids else "coulomb"
    if "braid_kinematics" in ids:
        fields["kinematics"] = "constant_thickness"
    if "rate_friction" in ids:
        fields["speeds"] = 2
    if ids & {"rate_friction", "presliding"}:
        fields["rows_max"] = 3000  # a turn that lasts a twentieth of the stroke needs rows inside it
    return fields


def _loops_fields(rng: random.Random) -> dict[str, Any]:
    """A declared simulation with free moduli."""
    if rng.random() < 0.3:
        return {
            "moduli": "loops",
            "law": "linear",
            "order": 4,
            "strain": "stretch",
            "kinematics": "constant_thickness",
        }
    return {
        "moduli": "loops",
        "law": rng.choice(("linear", "linear", "free", "constant")),
        "order": rng.choice((2, 3)),
    }


def _null(half: Half, rng: random.Random, index: int) -> Recipe:
    fields: dict[str, Any] = {
        "levels": rng.choice((3, 4, 5, 6, 8)),
        "cycles": rng.choice((1, 2, 3)),
        "friction": rng.choice(("coulomb", "coulomb", "strand", "none")),
    }
    if rng.random() < 0.45:
        fields |= _loops_fields(rng)
    elif rng.random() < 0.3:
        fields["kinematics"] = "constant_thickness"
    fields["floor"] = rng.random() < 0.15
    return _base(half, rng, "null", "null", index, **fields)


def _separable(half: Half, rng: random.Random, index: int) -> Recipe:
    size = 1 + index % 3
    loops = rng.random() < 0.3
    pool = list(HISTORY_AND_RIG if loops else IDS)
    first = pool[(index // 3) % len(pool)]
    others = [i for i in pool if i != first and {i, first} != {"coulomb_friction", "strand_friction"}]
    chosen = [first]
    while len(chosen) < size:
        pick = rng.choice(others)
        if {pick, *chosen} >= {"coulomb_friction", "strand_friction"} or pick in chosen:
            continue
        chosen.append(pick)
    effects = tuple(_wanted(half, rng, i, 1.0, 9.0) for i in sorted(chosen))
    fields = _suited(effects, rng) | (_loops_fields(rng) if loops else {})
    return _base(half, rng, "separable", "loops" if loops else "tensile", index, effects=effects, **fields)


def _inseparable(half: Half, rng: random.Random, index: int) -> Recipe:
    design = ("free_static", "short", "faint", "twins")[index % 4]
    fields: dict[str, Any] = {}
    if design == "free_static":  # free moduli of a high order take up what is static
        ids = sorted(rng.sample(STATIC[:6], rng.choice((1, 2))))
        effects = tuple(_wanted(half, rng, i, 0.3, 1.5) for i in ids)
        fields = {"moduli": "loops", "law": "linear", "order": 4}
    elif design == "short":  # one cycle, one speed, few levels
        ids = rng.sample(
            ("stress_softening", "creep", "force_drift", "pressure_droop", "presliding", "dead_band"), 2
        )
        ids = ["creep" if i == "stress_softening" else i for i in ids]
        effects = tuple(_wanted(half, rng, i, 0.1, 0.5) for i in sorted(set(ids)))
        fields = {"cycles": 1, "speeds": 1, "levels": rng.choice((1, 2, 3))}
    elif design == "faint":  # below what the noise lets through; presliding stands out in the rows of a turn
        pool = [i for i in STATIC + HISTORY_AND_RIG if i != "presliding"]
        effects = (_wanted(half, rng, rng.choice(pool), 0.01, 0.03),)
    else:  # effects that mimic each other, small
        pair = rng.choice(
            (
                ("braid_angle", "dead_band"),
                ("length_offset", "rig_compliance"),
                ("braid_angle", "wall_pressure"),
                ("length_offset", "tip_shape"),
                ("creep", "stress_softening"),
                ("law_shape", "order_too_low"),
            )
        )
        effects = tuple(_wanted(half, rng, i, 0.06, 0.2) for i in pair)
    fields = _suited(effects, rng) | fields
    return _base(half, rng, "inseparable", design, index, effects=effects, **fields)


def _outside(half: Half, rng: random.Random, index: int) -> Recipe:
    kind = half.outside[index % len(half.outside)]
    effects: tuple[Wanted, ...] = ()
    if rng.random() < 0.2:
        effects = (_wanted(half, rng, rng.choice(HISTORY_AND_RIG + STATIC), 4.0, 8.0),)
    low, high = (2.5, 5.0) if kind == "quantisation" else (1.5, 5.0)
    loops = _loops_fields(rng) if rng.random() < 0.3 and not effects else {}
    return _base(
        half,
        rng,
        "outside",
        kind,
        index,
        effects=effects,
        outside=kind,
        outside_multiple=round(rng.uniform(low, high), 3),
        **(_suited(effects, rng) | loops),
    )


@cache
def recipes(name: str) -> tuple[Recipe, ...]:
    """All recipes of "develop", "practice" or "locked"."""
    half = {half.name: half for half in (DEVELOP_HALF, PRACTICE_HALF, LOCKED_HALF)}[name]
    makers = {"null": _null, "separable": _separable, "inseparable": _inseparable, "outside": _outside}
    made = []
    for group, count in half.counts.items():
        rng = random.Random(f"{half.seed}-{group}")
        made += [makers[group](half, rng, j) for j in range(count)]
    return tuple(made)


def digest(name: str) -> str:
    """SHA-256 of the set's declaration."""
    text = json.dumps([asdict(r) for r in recipes(name)], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()
