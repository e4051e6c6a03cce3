"""``mpam-calib diagnose SPECIMEN -o RUN``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from mpam_calib.cli.app import app


@app.command()
def diagnose(
    specimen: Annotated[
        Path, typer.Argument(metavar="SPECIMEN", help="specimen folder or its specimen.toml")
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="RUN", help="the RUN folder to write")],
    seed: Annotated[int, typer.Option(help="seed of every random choice", min=0)] = 0,
) -> None:
    """Show what the declared simulation gets wrong, name the cause, extend the model, measure the gain.

    Writes diagnosis.json, report.html and the extended model's extended/specimen.toml to RUN.

    The same command goes on where it was interrupted, and keeps what is finished.
    """
    from mpam_calib.cli.progress import stage_progress
    from mpam_calib.run.diagnose import diagnose_to_folder

    with stage_progress() as tell:
        found = diagnose_to_folder(specimen, output, seed=seed, tell=tell)
    said = json.loads((output / "diagnosis.json").read_text(encoding="utf-8"))
    causes = ", ".join(cause["id"] for cause in said["causes"])
    print(f"{said['verdict']}{': ' + causes if causes else ''}")
    print(f"{output / 'report.html'} {'written' if found else 'kept (same data, model and options)'}")
