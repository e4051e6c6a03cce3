"""``mpam-calib calibrate SPECIMEN -o RUN``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpam_calib.cli import NOT_CONVERGED
from mpam_calib.cli.app import app


@app.command()
def calibrate(
    specimen: Annotated[Path, typer.Argument(help="specimen folder or its specimen.toml")],
    output: Annotated[Path, typer.Option("-o", "--output", help="the RUN folder to write")],
    seed: Annotated[int, typer.Option(help="seed of every random choice", min=0)] = 0,
    max_steps: Annotated[int, typer.Option(help="budget: sampling steps of each ensemble", min=1)] = 4000,
    ess: Annotated[float, typer.Option(help="effective draws wanted of every parameter", min=1)] = 400.0,
    remainder: Annotated[bool, typer.Option(help="with a remainder for what the physics leaves")] = True,
    correlated_noise: Annotated[bool, typer.Option(help="with noise that is correlated in time")] = True,
) -> None:
    """Draw the posterior of the declared simulation; writes draws, tables, bands and a report."""
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
