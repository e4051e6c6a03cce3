"""Arguments that several commands have in common."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

SpecimenPath = Annotated[
    Path, typer.Argument(metavar="SPECIMEN", help="Specimen folder, or its specimen.toml.")
]
RunToWrite = Annotated[
    Path, typer.Option("-o", "--output", metavar="RUN", help="Folder to write, resume or keep.")
]
RunToRead = Annotated[Path, typer.Argument(metavar="RUN", help="Folder that calibrate wrote.")]
AnySeed = Annotated[int, typer.Option(help="Seed of every random choice.", min=0)]
