"""``select`` from a specimen folder to a RUN folder: models.csv, prior_sensitivity.csv, report.html."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mpam_calib.criticism.selection.select import Selection, select
from mpam_calib.criticism.tasks.journal import Journal
from mpam_calib.posterior.material import demand_other, material_of
from mpam_calib.posterior.stored import RUN_FILE
from mpam_calib.report.selection import selection_page
from mpam_calib.run.files import KEPT_FILE, demand_forces, demand_own, demand_writable, write_csv
from mpam_calib.run.folder import run_digest
from mpam_calib.run.kept import Kept
from mpam_calib.run.provenance import provenance
from mpam_calib.run.replaced import tell_replaced
from mpam_calib.specimen import read

FILES = ("models.csv", "prior_sensitivity.csv", "report.html")


def select_to_folder(
    source: Path,
    run: Path,
    *,
    seed: int = 0,
    replicates: int = 8,
    tell: Callable[[str, float], None] | None = None,
) -> Selection | None:
    """Rank the model space into a RUN folder; None where it is kept, since it holds the same already.

    What an interruption has left is gone on with. Raises ``InputError`` before anything is written.
    """
    specimen = read(source)
    demand_own(run, RUN_FILE, KEPT_FILE)
    demand_other(specimen, run)
    material = material_of(specimen)
    digest = run_digest(specimen, command="select", seed=seed, replicates=replicates, material=material)
    kept = Kept(run, "select", digest, FILES)
    if kept.finished():
        return None
    demand_writable(run)
    demand_forces(specimen, "one to select on")
    tell_replaced(run, "selection")
    journal = Journal(kept.unfinished)
    with kept.unfinished.resumable():
        found = select(
            specimen, seed=seed, replicates=replicates, material=material, tell=tell, journal=journal
        )
    kept.begin()
    write_csv(found.models, run / "models.csv")
    write_csv(found.sensitivity, run / "prior_sensitivity.csv")
    page = selection_page(found, specimen, material)
    page.under(provenance(specimen)).write(run / "report.html")
    kept.finish()
    return found
