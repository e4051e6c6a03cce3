"""``reproduce``: the thesis recomputed, number by number."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mpam_calib.cli.app import app


@app.command()
def reproduce(
    out: Annotated[Path, typer.Option("-o", "--output", help="folder for reproduction.csv and report.html")],
    seed: Annotated[int, typer.Option(help="seed of the stochastic searches", min=0)] = 0,
) -> None:
    """Recompute every table and number of the thesis and name its misprints."""
    from rich.console import Console

    from mpam_calib.thesis.page import page
    from mpam_calib.thesis.reproduction import reproduce as recompute

    result = recompute(seed)
    out.mkdir(parents=True, exist_ok=True)
    result.ledger.write(out / "reproduction.csv")
    page(result).write(out / "report.html")
    console = Console()
    console.print(result.ledger.summary(), soft_wrap=True)
    console.print(f"see {out / 'report.html'}", soft_wrap=True)
