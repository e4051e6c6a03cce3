"""``mpam-calib init``: a commented specimen folder to fill in."""

from __future__ import annotations

import shlex
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from mpam_calib.cli.app import app


@app.command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to make (it may exist).")],
) -> None:
    """Write a commented specimen.toml into DIR; the data files that it names go beside it."""
    from mpam_calib.errors import InputError
    from mpam_calib.specimen.toml_source import SPECIMEN_FILE
    from mpam_calib.specimen.wording import one_line

    target = folder / SPECIMEN_FILE
    if target.exists():
        raise InputError(target, "a specimen that is there already", "a folder without one")
    template = resources.files("mpam_calib.specimen").joinpath("templates", SPECIMEN_FILE)
    text = template.read_text(encoding="utf-8")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
    except FileExistsError:
        raise InputError(folder, "a file", "a folder to make") from None
    except OSError as error:
        there = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
        if not there.is_dir():
            raise InputError(there, "a file", "a folder to make the specimen in") from None
        found = f"a folder that may not be written ({one_line(error.strerror or error)})"
        raise InputError(there, found, "one that may") from None
    command = f"mpam-calib check {shlex.quote(str(folder))}"
    typer.echo(f"{target}: edit it, put loops.csv beside it, then run: {command}")
