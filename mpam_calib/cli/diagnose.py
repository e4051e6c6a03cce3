"""``mpam-calib diagnose SPECIMEN -o RUN``."""

from __future__ import annotations

import json

from mpam_calib.cli.app import app
from mpam_calib.cli.arguments import AnySeed, RunToWrite, SpecimenPath
from mpam_calib.cli.telling import tell_page


@app.command()
def diagnose(
    specimen: SpecimenPath,
    output: RunToWrite,
    seed: AnySeed = 0,
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
    tell_page(output, kept=found is None)
