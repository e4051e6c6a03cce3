"""The typer application: every command is registered here and lives in its own module."""

from __future__ import annotations

from importlib import import_module
from importlib.metadata import version
from typing import Any

import typer
from typer.core import TyperGroup

ORDER = ("init", "check", "calibrate", "select", "diagnose", "predict", "optimize", "simulate", "reproduce")
"""From a new specimen to what its calibration is used for: the order in which the help lists them."""


class InOrder(TyperGroup):
    """The commands in the order of use, whatever the order in which they were registered."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Their names."""
        names = super().list_commands(ctx)
        return sorted(names, key=lambda name: ORDER.index(name) if name in ORDER else len(ORDER))


app = typer.Typer(
    name="mpam-calib",
    cls=InOrder,
    help="Bayesian calibration of pneumatic artificial muscles.",
    epilog="SPECIMEN is a specimen folder or its specimen.toml; RUN a folder of results.",
    add_completion=False,
    pretty_exceptions_enable=False,
    # Plain text: readable in a narrow window and in a log.
    rich_markup_mode=None,
)


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(version("mpam-calib"))
        raise typer.Exit


@app.callback()
def _main(
    version: bool = typer.Option(
        False, "--version", callback=_tell_version, is_eager=True, help="The version."
    ),
) -> None:
    """Options of the program itself."""


# Each command's module registers its own on ``app``, and so needs it first.
for _name in ORDER:
    import_module(f"mpam_calib.cli.{_name}")
