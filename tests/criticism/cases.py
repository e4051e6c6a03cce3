"""Cases of the rig as the criticism sees them: read from their folders, and reduced."""

from __future__ import annotations

import tempfile
from pathlib import Path

from rig import case as rig_case
from rig import recipes, sets

from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.searching.usual_braid import with_strands
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.specimen import Specimen, read

DECLARED = Options(nuisances=False, remainder=False)
"""The declared simulation alone, without nuisances and remainder."""


def null_recipe() -> recipes.Recipe:
    """A muscle with tensile moduli in which nothing is hidden."""
    return next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "tensile")


def specimen_of(name: str, which: str = "develop") -> Specimen:
    """The specimen of a named case, whose folder stays."""
    recipe = next(r for r in sets.recipes(which) if r.name == name)
    return _read(recipes.build_case(recipe), Path(tempfile.mkdtemp()))


def read_case(one: rig_case.Case) -> Specimen:
    """The specimen of a case, whose folder is gone; raises ``InputError`` where it is refused at the door."""
    with tempfile.TemporaryDirectory() as folder:
        return _read(one, Path(folder))


def _read(one: rig_case.Case, folder: Path) -> Specimen:
    rig_case.write_case(one, folder / "specimen", folder / "truth.json")
    return read(folder / "specimen")


def problem_of(specimen: Specimen) -> Problem:
    """Its reduced rows, with the strands that it declares."""
    return build_problem(specimen, draw_blueprint(specimen, DECLARED))


def diagnosed_problem_of(specimen: Specimen) -> Problem:
    """Its reduced rows as ``diagnose`` poses them, usual strands where it declares none."""
    return build_problem(specimen, with_strands(draw_blueprint(specimen, DECLARED)))
