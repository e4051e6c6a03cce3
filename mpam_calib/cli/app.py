"""The typer application: every command is registered here and lives in its own module."""

from __future__ import annotations

import typer

app = typer.Typer(
    name="mpam-calib",
    help="Bayesian calibration of pneumatic artificial muscles.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
