"""``mpam-calib diagnose SPECIMEN -o RUN``."""

from __future__ import annotations

import json
from typing import Any

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
    print(verdict_line(said))
    tell_page(output, kept=found is None)


def verdict_line(said: dict[str, Any]) -> str:
    """One line on what ``diagnosis.json`` says, with no word that would be taken for more than it is."""
    from mpam_calib.report.diagnosis_lead import likelier

    word, causes = said["verdict"], ", ".join(cause["id"] for cause in said["causes"])
    if word == "adequate" and (rival := likelier(said)):
        return f"adequate, with a doubt: {' and '.join(rival['ids'])} more probable than no cause"
    if not causes:
        return str(word)
    return f"unexplained even with {causes}" if word == "unexplained" else f"{word}: {causes}"
