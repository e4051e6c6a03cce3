"""The typer application: every command is registered here and lives in its own module."""

from __future__ import annotations

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
    epilog="SPECIMEN is a specimen folder or its specimen.toml; RUN a folder that calibrate wrote.",
    add_completion=False,
    pretty_exceptions_enable=False,
    # Plain text: readable in a narrow window and in a log.
    rich_markup_mode=None,
)

# The commands: each module registers its own on ``app``.
from mpam_calib.cli import init  # noqa: E402, F401  isort: skip
from mpam_calib.cli import check  # noqa: E402, F401  isort: skip
from mpam_calib.cli import calibrate  # noqa: E402, F401  isort: skip
from mpam_calib.cli import predict  # noqa: E402, F401  isort: skip
from mpam_calib.cli import optimize  # noqa: E402, F401  isort: skip
from mpam_calib.cli import reproduce  # noqa: E402, F401  isort: skip
from mpam_calib.cli import simulate  # noqa: E402, F401  isort: skip
from mpam_calib.cli import diagnose  # noqa: E402, F401  isort: skip
from mpam_calib.cli import select  # noqa: E402, F401  isort: skip
