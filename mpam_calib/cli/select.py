"""``mpam-calib select SPECIMEN -o RUN``."""

from __future__ import annotations

from typing import Annotated

import typer

from mpam_calib.cli.app import app
from mpam_calib.cli.arguments import AnySeed, RunToWrite, SpecimenPath
from mpam_calib.cli.telling import tell_page


@app.command()
def select(
    specimen: SpecimenPath,
    output: RunToWrite,
    seed: AnySeed = 0,
    replicates: Annotated[int, typer.Option(help="Replicates of the confusion matrix (0: none).", min=0)] = 8,
) -> None:
    """Rank orders, laws, frictions, kinematics and strain conventions by evidence and held-out levels.

    Writes models.csv, prior_sensitivity.csv and report.html to RUN.

    The same command goes on where it was interrupted, and keeps what is finished.
    """
    import pandas as pd

    from mpam_calib.cli.progress import stage_progress
    from mpam_calib.report.numbers import probability
    from mpam_calib.report.selection import compared, selection_sentence, short_name
    from mpam_calib.run.select import select_to_folder

    with stage_progress() as tell:
        found = select_to_folder(specimen, output, seed=seed, replicates=replicates, tell=tell)
    models = pd.read_csv(output / "models.csv", keep_default_na=False)
    best = short_name(models.iloc[0], compared(models))
    likely = probability(float(models["probability"].iloc[0]))
    print(selection_sentence(models))
    print(f"first of {len(models)}: {best} (probability {likely})")
    tell_page(output, kept=found is None)
