"""Strands of the usual kind where none are declared.

What strands do shows in how the force goes with pressure and contraction, whatever they are made of. Only the
size of it has a meaning for the strands of a [braid] alone.
"""

from __future__ import annotations

from mpam_calib.model.blueprint import Blueprint
from mpam_calib.model.effect import effect
from mpam_calib.specimen.declaration import Braid, Geometry

NYLON = {"E_br_GPa": 2.1, "nu_s": 0.33}
STRANDS, THICKNESS = 48, 0.04
"""Strands of a usual sleeve, and their radius as a share of the muscle's: nominal values of ours."""
SHAPE_ALONE = "no [braid] in specimen.toml: looked for by its shape alone, it is not among the causes"


def usual_braid(geometry: Geometry) -> Braid:
    """Nylon strands as thick, and as many, as muscles of this radius have."""
    return Braid(**NYLON, R_br_mm=float(f"{THICKNESS * geometry.R0_mm:.3g}"), n=STRANDS)


def with_strands(blueprint: Blueprint) -> Blueprint:
    """The blueprint with usual strands where it has none."""
    if blueprint.braid is not None or blueprint.geometry is None:
        return blueprint
    return blueprint.model_copy(update={"braid": usual_braid(blueprint.geometry)})


def need_strands(identifiers: tuple[str, ...]) -> tuple[str, ...]:
    """Those of the effects whose size is stated for declared strands."""
    return tuple(e for e in identifiers if effect(e).needs_braid)
