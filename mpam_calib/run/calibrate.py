"""``calibrate`` from a specimen folder to a RUN folder: kept, resumed, or drawn anew."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path

from mpam_calib.calibration import calibrate
from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import MaterialPosterior, Options
from mpam_calib.posterior.convergence import ESS_WANTED
from mpam_calib.posterior.sampling import MAX_STEPS, Listener
from mpam_calib.run.folder import RunFolder, material_of, run_digest
from mpam_calib.specimen import Specimen, read

OUTPUTS = ("posterior.nc", "summary.csv", "bands.csv", "run.json", "report.html", "predictions.csv")


@dataclass(frozen=True)
class Outcome:
    """How a run ended: whether it converged, and whether an earlier result was kept."""

    converged: bool
    kept: bool


def resolve_material(specimen: Specimen) -> MaterialPosterior | None:
    """The posterior that ``moduli = "run:PATH"`` names (relative to the specimen's folder), if it does."""
    moduli = specimen.simulation.moduli
    if not moduli.startswith("run:"):
        return None
    return material_of((specimen.folder / moduli.removeprefix("run:").strip()).resolve())


def calibrate_to_folder(
    source: str | Path,
    run: Path,
    *,
    seed: int = 0,
    max_steps: int = MAX_STEPS,
    ess_wanted: float = ESS_WANTED,
    options: Options | None = None,
    listener: Listener | None = None,
) -> Outcome:
    """Calibrate a specimen into a RUN folder.

    A finished run of the same digest is kept, an unfinished one resumed, any other replaced. Raises
    ``InputError`` before anything is written.
    """
    specimen = read(source)
    material = resolve_material(specimen)
    options = options or Options()
    digest = run_digest(
        specimen.digest,
        command="calibrate",
        seed=seed,
        options=options.model_dump(),
        ess=ess_wanted,
        material=None if material is None else material.model_dump(),
    )
    folder = RunFolder(run, digest)
    if run.exists() and not run.is_dir():
        raise InputError(run, "a file", "a folder to write into, or a new name")
    state = folder.state()
    complete = state is not None and all((run / name).exists() for name in OUTPUTS[:-1])
    if complete and state is not None:
        used = int(state["sampling"]["steps"])
        if state["converged"] or max_steps <= used:
            return Outcome(bool(state["converged"]), kept=True)
    calibration = calibrate(
        specimen,
        seed=seed,
        max_steps=max_steps,
        ess_wanted=ess_wanted,
        options=options,
        material=material,
        checkpoint=folder.checkpoint,
        listener=listener,
    )
    for name in OUTPUTS:
        (run / name).unlink(missing_ok=True)
    from mpam_calib.report.calibration import calibration_page
    from mpam_calib.run.view import view_of

    folder.write(calibration)
    calibration_page(view_of(calibration)).write(run / "report.html")
    if calibration.converged:
        shutil.rmtree(run / "checkpoint", ignore_errors=True)
    return Outcome(calibration.converged, kept=False)
