"""``reproduce``: the thesis recomputed, number by number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpam_calib.cli.app import app


@app.command()
def reproduce(
    out: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder for reproduction.csv and report.html."),
    ],
    seed: Annotated[int, typer.Option(help="Seed of the stochastic searches.", min=0)] = 0,
    mpam1: Annotated[Path | None, typer.Option(help="RUN folder whose bands are shown for MPAM1.")] = None,
    mpam2: Annotated[Path | None, typer.Option(help="RUN folder whose bands are shown for MPAM2.")] = None,
    mpam1_strand: Annotated[
        Path | None, typer.Option(help="RUN folder of MPAM1 with strand friction, for f_s and Fig. 4.21.")
    ] = None,
) -> None:
    """Recompute every table and number of the thesis and name its misprints."""
    from rich.console import Console

    from mpam_calib.cli.telling import warn_unconverged
    from mpam_calib.run.files import REPRODUCTION, demand_folder
    from mpam_calib.thesis.page import page
    from mpam_calib.thesis.posterior import MPAM1, MPAM1_STRAND, MPAM2, MuscleBands, missing
    from mpam_calib.thesis.reproduction import reproduce as recompute

    demand_folder(out, REPRODUCTION)
    runs = {MPAM1: mpam1, MPAM2: mpam2, MPAM1_STRAND: mpam1_strand}
    bands = {name: MuscleBands.read(name, run) for name, run in runs.items() if run is not None}
    for run in filter(None, runs.values()):
        warn_unconverged(run)
    result = recompute(seed)
    out.mkdir(parents=True, exist_ok=True)
    result.ledger.write(out / REPRODUCTION)
    page(result, bands).write(out / "report.html")
    console = Console()
    console.print(result.ledger.summary(), soft_wrap=True)
    absent = missing(bands)
    if len(absent):
        names = "; ".join(absent["run"])
        console.print(
            f"no posterior given of: {names} (the report's last section says how)",
            soft_wrap=True,
            markup=False,
        )
    console.print(f"see {out / 'report.html'}", soft_wrap=True, markup=False)
