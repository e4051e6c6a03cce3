"""``mpam-calib optimize RUN [--seed]``."""

from __future__ import annotations

from typing import Annotated

import typer

from mpam_calib.cli.app import app
from mpam_calib.cli.arguments import RunToRead
from mpam_calib.cli.telling import warn_unconverged


@app.command()
def optimize(
    run: RunToRead,
    seed: Annotated[int, typer.Option(help="Seed of the searches and the tolerances.", min=0)] = 0,
) -> None:
    """Find the muscles with the largest blocked force, under the posterior of a run.

    Case I and Case II of the thesis at the pressures of its Table 3.5: the design that maximises the
    posterior mean of blocked force and the one that maximises its 5 % quantile, each with bands on blocked
    force and free contraction, in RUN/designs.csv and RUN/designs.html.
    """
    from mpam_calib.run.optimize import optimize_to_folder

    written = optimize_to_folder(run, seed)
    warn_unconverged(run)
    for path in written:
        print(path)
