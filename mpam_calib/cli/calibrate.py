"""``mpam-calib calibrate SPECIMEN -o RUN``."""

from __future__ import annotations

from typing import Annotated

import typer

from mpam_calib.cli import NOT_CONVERGED
from mpam_calib.cli.app import app
from mpam_calib.cli.arguments import AnySeed, RunToWrite, SpecimenPath
from mpam_calib.cli.telling import tell_page


@app.command()
def calibrate(
    specimen: SpecimenPath,
    output: RunToWrite,
    seed: AnySeed = 0,
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
    tell_page(output, kept=outcome.kept)
    if not outcome.converged:
        print("not converged within the budget: see run.json; a larger --max-steps resumes")
        raise typer.Exit(NOT_CONVERGED)
