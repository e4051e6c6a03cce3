"""A progress bar with the time left, told by the share of the effective draws that are in."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

if TYPE_CHECKING:
    from mpam_calib.posterior.sampling import Listener
    from mpam_calib.posterior.sampling import Progress as Figures


@contextmanager
def sampling_progress(max_steps: int) -> Iterator[Listener]:
    """A listener that draws a bar on standard error."""
    columns = (
        TextColumn("{task.description:<11}"),
        BarColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[figures]}"),
    )
    with Progress(*columns, console=Console(file=sys.stderr), transient=True) as bar:
        task = bar.add_task("reading", total=1.0, figures="")

        def tell(figures: Figures) -> None:
            spent = figures.steps / max_steps
            text = ""
            if figures.steps:
                text = f"{figures.steps} steps, ESS {figures.ess:.0f}, R-hat {figures.rhat:.3f}"
            # Whatever comes first ends the run: enough draws, or the budget.
            bar.update(task, description=figures.stage, completed=max(figures.share, spent), figures=text)

        yield tell
