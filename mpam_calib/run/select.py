"""``select`` from a specimen folder to a RUN folder: models.csv, prior_sensitivity.csv, report.html."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mpam_calib.criticism.select import Selection, select
from mpam_calib.report.selection import selection_page
from mpam_calib.run.calibrate import resolve_material
from mpam_calib.run.files import demand_folder, write_csv
from mpam_calib.specimen import read


def select_to_folder(
    source: Path,
    run: Path,
    *,
    seed: int = 0,
    replicates: int = 8,
    tell: Callable[[str, float], None] | None = None,
) -> Selection:
    """Rank the model space into a RUN folder; raises ``InputError`` before anything is written."""
    specimen = read(source)
    demand_folder(run)
    material = resolve_material(specimen)
    found = select(specimen, seed=seed, replicates=replicates, material=material, tell=tell)
    write_csv(found.models, run / "models.csv")
    write_csv(found.sensitivity, run / "prior_sensitivity.csv")
    selection_page(found, specimen).write(run / "report.html")
    return found
