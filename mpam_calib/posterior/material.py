"""A bladder material taken from another run: what ``moduli = "run:PATH"`` stands for."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import tomlkit

from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import MaterialPosterior
from mpam_calib.posterior.draws import reported
from mpam_calib.posterior.stored import RUN_FILE, load_run
from mpam_calib.specimen.recording import Specimen

PREFIX = "run:"


def material_folder(specimen: Specimen) -> Path | None:
    """The RUN that the moduli are declared to come from (relative to the specimen's folder), if any."""
    moduli = specimen.simulation.moduli
    if not moduli.startswith(PREFIX):
        return None
    return (specimen.folder / moduli.removeprefix(PREFIX).strip()).resolve()


def demand_other(specimen: Specimen, run: Path) -> None:
    """Raise ``InputError`` where results would go into the RUN that the moduli come from."""
    if material_folder(specimen) == run.resolve():
        raise InputError(run, "the run that the moduli come from", "one of its own for these results")


def material_of(specimen: Specimen) -> MaterialPosterior | None:
    """The moduli that the declared RUN found, if one is declared; raises ``InputError`` where it has none."""
    folder = material_folder(specimen)
    if folder is None:
        return None
    run = load_run(folder)
    blueprint = run.model.blueprint
    names = [f"E_{k}" for k in range(1, blueprint.simulation.order + 1)]
    listed = {item.name: item.draws for item in reported(run.model, run.draws)}
    if not set(names) <= set(listed):
        raise InputError(folder / RUN_FILE, "moduli that depend on pressure", "a run with a constant law")
    draws = np.stack([listed[name] for name in names])
    return MaterialPosterior(
        mean=tuple(float(v) for v in draws.mean(axis=1)),
        covariance=tuple(tuple(float(v) for v in row) for row in np.atleast_2d(np.cov(draws))),
        # A muscle's run may have a tensile test beside it that its moduli owe nothing to.
        strain_range=None if run.model.tensile is None else blueprint.tensile_range,
        convention=blueprint.simulation.strain,
    )


def keep_material(document: tomlkit.TOMLDocument, specimen: Specimen, folder: Path) -> None:
    """Let a specimen's declaration find the RUN of its moduli from another folder."""
    if (target := material_folder(specimen)) is not None:
        document["simulation"]["moduli"] = f"{PREFIX}{os.path.relpath(target, folder.resolve())}"
