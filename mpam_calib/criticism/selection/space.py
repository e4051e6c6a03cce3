"""The models that ``select`` compares: every simulation that a specimen's files could carry."""

from __future__ import annotations

from itertools import product

import numpy as np

from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import Specimen

ORDERS = range(1, 7)
LAWS = {"constant": 1, "linear": 2, "free": 3, "exponential": 3, "exponential_each": 4}
"""Laws and the levels that each needs, if it is not the declared one; a law after one that it holds as a
special case."""
TWINS = {1: "constant", 2: "linear"}
"""The law that moduli free at so many levels are."""


def model_space(specimen: Specimen) -> list[Simulation]:
    """Every such simulation, the declared one among them; its effects and the moduli's source are kept.

    A single modulus has the same exponential law whether rates are shared or not, and moduli free at two
    levels are a linear law's, at one a constant law's: each is there once, by the declared name.
    What a declared effect adds is not there a second time. Laws vary fastest and in the order of LAWS
    (:mod:`mpam_calib.criticism.selection.ranking` starts each from the one before).
    """
    declared = specimen.simulation
    frictions: list[str] = [declared.friction]  # without branches all are one model
    parts = [p for p in (specimen.loops, specimen.force_map) if p is not None]
    if any(np.any(p.branch == 1) and np.any(p.branch == -1) for p in parts):
        frictions = ["coulomb", "none"] + (["strand"] if specimen.braid is not None else [])
    orders = sorted({*ORDERS, declared.order})
    laws = [law for law, needed in LAWS.items() if len(specimen.levels_Pa) >= needed or law == declared.law]
    if declared.law == "free":
        laws = [law for law in laws if law != TWINS.get(len(specimen.levels_Pa))]
    strains = ["engineering", "stretch"]
    if declared.moduli != "loops":
        orders, laws, strains = [declared.order], ["constant"], [declared.strain]
    kinematics = ["inextensible_braid", "constant_thickness"]
    twice = "exponential" if (declared.law, declared.order) == ("exponential_each", 1) else "exponential_each"
    models = (
        declared.model_copy(
            update={"kinematics": k, "strain": s, "order": m, "friction": f, "law": w}
            | ({"friction_by_pressure": False} if f != declared.friction else {})
        )
        for k, s, m, f, w in product(kinematics, strains, orders, frictions, laws)
        if (w, m) != (twice, 1)
    )
    return [m for m in models if not m.effects_within.keys() & set(declared.effect_ids)]
