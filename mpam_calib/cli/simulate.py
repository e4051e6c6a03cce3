"""``mpam-calib simulate SPECIMEN -o DIR [--hide ID[=VALUE] ...]``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpam_calib.cli.app import app
from mpam_calib.cli.arguments import SpecimenPath
from mpam_calib.cli.telling import warn
from mpam_calib.errors import InputError


@app.command()
def simulate(
    specimen: SpecimenPath,
    output: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Specimen folder to write.")],
    more: Annotated[
        list[str] | None, typer.Argument(metavar="ID", help="Further effects, after --hide.")
    ] = None,
    hide: Annotated[
        list[str] | None,
        typer.Option(
            help="ID, ID:FORM, ID=VALUE or ID:FORM=VALUE: an effect to hide, "
            "its size in its parameter's unit."
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of the noise.", min=0)] = 0,
) -> None:
    """Write a specimen folder with synthetic recordings of the declared simulation.

    Writes specimen.toml, loops_synthetic.csv or force_map_synthetic.csv, and truth.json (what was hidden) to
    DIR; with a tensile test, tensile.csv.
    """
    from mpam_calib.prediction.simulate import simulate as make
    from mpam_calib.run.synthetic import demand_synthetic_folder, write_specimen
    from mpam_calib.specimen import read
    from mpam_calib.specimen.toml_source import SPECIMEN_FILE, declaration_of

    if more and not hide:
        raise InputError("simulate", f'"{more[0]}"', "one specimen")
    source = declaration_of(specimen)
    if output.resolve() == source.parent.resolve():
        raise InputError(output, "the specimen's own folder", "another folder")
    demand_synthetic_folder(output)
    real = read(specimen, data_required=False)
    made = make(real, _sizes([*(hide or []), *(more or [])]), seed)
    write_specimen(made, source, output)
    warn(f"{name} changes no force that this recording could show" for name in made.not_shown)
    left = [file.name for file in real.files if file.kind in ("blocked_force", "free_contraction")]
    if left:
        print(f"not simulated: {', '.join(left)}")
    print(output / SPECIMEN_FILE)


def _sizes(hide: list[str]) -> dict[str, float | None]:
    """Effect ids and their sizes in lab units."""
    sizes: dict[str, float | None] = {}
    for text in hide:
        identifier, equals, number = text.partition("=")
        base = identifier.partition(":")[0]
        if any(base == known.partition(":")[0] for known in sizes):
            raise InputError("--hide", f"{base} twice", "each effect once")
        try:
            sizes[identifier] = float(number) if equals else None
        except ValueError as error:
            raise InputError("--hide", f'"{text}"', "ID or ID=NUMBER") from error
    return sizes
