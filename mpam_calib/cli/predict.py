"""``mpam-calib predict RUN [--pressure A:B:STEP]``."""

from __future__ import annotations

from typing import Annotated

import typer

from mpam_calib.cli.app import app
from mpam_calib.cli.arguments import RunToRead
from mpam_calib.cli.telling import warn, warn_unconverged


@app.command()
def predict(
    run: RunToRead,
    pressure: Annotated[
        str | None,
        typer.Option(
            metavar="A:B:STEP",
            help="One pressure A, or A:B:STEP, in kPa, B included; without it, the data's levels.",
        ),
    ] = None,
    seed: Annotated[
        int | None, typer.Option(help="Seed of the noise in new readings; without it, the run's.", min=0)
    ] = None,
) -> None:
    """Predict force and free contraction at any pressures.

    Writes bands on force, blocked force and free contraction to RUN/predictions.csv, with the columns
    of bands.csv: q05 to q95 is the 90 % band. Of force_N the branch "mean" is the curve without
    friction; "..._observed" is what a load cell would read, noise included. All are of the settled
    muscle: after many cycles, just after the pressure was reached. What lies beyond the data
    is marked as extrapolated, and outside the recorded pressures bands widen with the distance. Warns
    where the bands at an asked pressure are not to be relied on.
    """
    from mpam_calib.run.predict import parse_pressures, predict_to_folder

    pressures = None if pressure is None else parse_pressures(pressure)
    predicted = predict_to_folder(run, pressures, seed)
    warn_unconverged(run)
    warn(predicted.remarks)
    print(predicted.path)
