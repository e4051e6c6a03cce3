"""``mpam-calib calibrate SPECIMEN -o RUN``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpam_calib.cli import NOT_CONVERGED
from mpam_calib.cli.app import app


@app.command()
def calibrate(
    specimen: Annotated[
        Path, typer.Argument(metavar="SPECIMEN", help="Specimen folder, or its specimen.toml.")
    ],
    output: Annotated[
        Path, typer.Option("-o", "--output", metavar="RUN", help="Folder to write, resume or keep.")
    ],
    seed: Annotated[int, typer.Option(help="Seed of every random choice.", min=0)] = 0,
    max_steps: Annotated[int, typer.Option(help="Budget: sampling steps of each ensemble.", min=1)] = 4000,
    ess: Annotated[float, typer.Option(help="Effective draws wanted of every parameter.", min=1)] = 400.0,
    remainder: Annotated[
        bool, typer.Option("--remainder/--no-remainder", help="Allow for what the physics leaves out.")
    ] = True,
    correlated_noise: Annotated[
        bool,
        typer.Option("--correlated-noise/--no-correlated-noise", help="Allow for noise that lasts."),
    ] = True,
) -> None:
    """Find the simulation's parameters, with bands, from a specimen's data.

    Writes a report, the parameters, bands on what the muscle does and the draws behind them to RUN.

    The same command on an unfinished RUN resumes it and keeps a finished one; other data, another
    model, seed or options replace it. Exit code 3: not converged within the budget; a larger one
    resumes.
    """
    from mpam_calib.cli.progress import sampling_progress
    from mpam_calib.model.blueprint import Options
    from mpam_calib.run.calibrate import calibrate_to_folder

    options = Options(remainder=remainder, correlated_noise=correlated_noise)
    with sampling_progress(max_steps) as listener:
        outcome = calibrate_to_folder(
            specimen,
            output,
            seed=seed,
            max_steps=max_steps,
            ess_wanted=ess,
            options=options,
            listener=listener,
        )
    what = "kept (same data, model and options)" if outcome.kept else "written"
    print(f"{output / 'report.html'} {what}")
    if not outcome.converged:
        print("not converged within the budget: see run.json; a larger --max-steps resumes")
        raise typer.Exit(NOT_CONVERGED)
