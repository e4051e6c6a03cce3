"""``calibrate`` from a specimen folder to a RUN folder: kept, resumed, or drawn anew."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.model.blueprint import Options
from mpam_calib.posterior.chains.convergence import ESS_WANTED
from mpam_calib.posterior.chains.sampling import MAX_STEPS, Listener, Progress
from mpam_calib.posterior.material import demand_other, material_of
from mpam_calib.posterior.stored import RUN_FILE
from mpam_calib.run.files import KEPT_FILE, demand_own, demand_writable
from mpam_calib.run.folder import REPORT, RunFolder, run_digest
from mpam_calib.run.odd import tell_odd
from mpam_calib.run.replaced import tell_replaced
from mpam_calib.specimen import read
from mpam_calib.specimen.recording import Specimen


@dataclass(frozen=True)
class Outcome:
    """How a run ended: whether it converged, and whether an earlier result was kept."""

    converged: bool
    kept: bool


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
    demand_other(specimen, run)
    material = material_of(specimen)
    options = options or Options()
    digest = run_digest(
        specimen,
        command="calibrate",
        seed=seed,
        options=options.model_dump(),
        ess=ess_wanted,
        material=None if material is None else material.model_dump(),
    )
    folder = RunFolder(run, digest)
    demand_own(run, RUN_FILE, KEPT_FILE)
    if (kept := _kept(folder, max_steps)) is not None:
        return kept
    demand_writable(run)
    tell = listener or (lambda progress: None)
    tell(Progress("fitting", 0, float("nan"), 0.0, 0.0))
    with folder.checkpoint.resumable():
        calibration = calibrate(
            specimen,
            seed=seed,
            max_steps=max_steps,
            ess_wanted=ess_wanted,
            options=options,
            material=material,
            checkpoint=folder.checkpoint,
            listener=_told_first(run, specimen, source, tell),
        )
    figures = calibration.sampling.diagnostics
    steps = calibration.sampling.chain.shape[1]
    tell(Progress("reporting", steps, float(figures.rhat.max()), figures.ess_min, 1.0))
    _write(folder, calibration)
    return Outcome(calibration.converged, kept=False)


def _told_first(run: Path, specimen: Specimen, source: str | Path, tell: Listener) -> Listener:
    """A listener that says what looks odd and whose page goes once there are steps.

    Until then data may be refused, and that is told in one line.
    """
    notes = iter([run])

    def listener(progress: Progress) -> None:
        if progress.steps and next(notes, None):
            tell_replaced(run, "calibration")
            tell_odd(specimen, source)
        tell(progress)

    return listener


def _kept(folder: RunFolder, max_steps: int) -> Outcome | None:
    """How a finished run in the folder ended, where the budget would not change it; else None."""
    state = folder.state()
    if state is None or not folder.complete():
        return None
    used = int(state["sampling"]["steps"])
    cut = bool(state["sampling"].get("cut", False))
    if max_steps <= used or (state["converged"] and not cut):
        return Outcome(bool(state["converged"]), kept=True)
    return None


def _write(folder: RunFolder, calibration: Calibration) -> None:
    """Put the results in place of what was there; everything is made before anything goes."""
    from mpam_calib.report.calibration import calibration_page
    from mpam_calib.run.view import view_of

    bands = calibration.bands()
    view = view_of(calibration, bands)
    page = calibration_page(view)
    folder.clear()
    page.write(folder.path / REPORT)
    folder.write(calibration, bands, view.left_out)
    if calibration.converged:
        folder.checkpoint.clear()
