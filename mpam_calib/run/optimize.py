"""``optimize``: the best designs under a finished RUN's posterior."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from mpam_calib.calibration import predict
from mpam_calib.design.problem import R_BR
from mpam_calib.design.robust import Optimiser, designs_table
from mpam_calib.errors import InputError
from mpam_calib.posterior.stored import load_run
from mpam_calib.run.files import demand_writable, write_csv
from mpam_calib.run.folder import PROVENANCE
from mpam_calib.thesis.chapter3 import MONOFILAMENTS
from mpam_calib.thesis.tables import table
from mpam_calib.units import KPA

TABLE, REPORT = "designs.csv", "designs.html"
PRINTED = "3.5"
"""The thesis's table of optima by pressure."""
RADII = (R_BR.upper, MONOFILAMENTS[-1])
"""Upper bounds of R_br (m) with strands that must fit: Table 3.1's, and the thickest real monofilament."""


def optimize_to_folder(run: Path, seed: int = 0) -> tuple[Path, Path]:
    """Write ``RUN/designs.csv`` and ``RUN/designs.html``; returns their paths.

    Pressures are those of thesis Table 3.5. Raises ``InputError`` for a run without a muscle.
    """
    from mpam_calib.report.designs import DesignsView, designs_page

    stored = load_run(run)
    demand_writable(run)
    model = stored.model
    if model.setting is None:
        raise InputError(run / "run.json", "a material, not a muscle", "a run of a muscle")
    optimiser = Optimiser(model, stored.draws, seed)
    printed = table(PRINTED)
    pressures = [float(row) * KPA for row in printed.rows]
    found = [design for P in pressures for design in optimiser.at(P)]
    frame = designs_table(found)
    view = DesignsView(
        name=str(stored.state["specimen"]["name"]),
        converged=bool(stored.state["converged"]),
        blueprint=model.blueprint,
        designs=found,
        table=frame,
        packed=[optimiser.packed(P, RADII) for P in pressures],
        radii=RADII,
        printed={
            case: np.array([printed.value(row, f"Cost function (Case {case})") for row in printed.rows])
            for case in ("I", "II")
        },
        draws=(len(optimiser.few), len(optimiser.many)),
        tested=predict(model, stored.draws, stored.seed, [P / KPA for P in pressures]),
    )
    page = designs_page(view).under(str(stored.state.get(PROVENANCE, "")))
    write_csv(frame, run / TABLE)
    page.write(run / REPORT)
    return run / TABLE, run / REPORT
