"""A progress bar with the time left, told by the share of the effective draws that are in."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from mpam_calib.cli import stop_where_pressed

if TYPE_CHECKING:
    from mpam_calib.posterior.chains.sampling import Listener
    from mpam_calib.posterior.chains.sampling import Progress as Figures


@contextmanager
def sampling_progress(max_steps: int) -> Iterator[Listener]:
    """A listener that draws a bar on standard error; in a pipe or a log it stays quiet."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(file=sys.stderr)
    if not console.is_terminal:
        yield lambda figures: stop_where_pressed()
        return
    columns = (
        TextColumn("{task.description:<11}"),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TextColumn("gone,"),
        TimeRemainingColumn(),
        TextColumn("left {task.fields[figures]}"),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("reading", total=1.0, figures="")
        share = 0.0

        def tell(figures: Figures) -> None:
            nonlocal share
            stop_where_pressed()
            text = ""
            if figures.steps:
                text = f"({figures.steps} steps, ESS {figures.ess:.0f}, R-hat {figures.rhat:.3f})"
            # Whatever comes first ends the run: enough draws, or the budget. An estimate may fall
            # back, the bar does not.
            share = max(share, figures.share, figures.steps / max_steps)
            bar.update(task, description=figures.stage, completed=share, figures=text)

        yield tell


@contextmanager
def stage_progress() -> Iterator[Callable[[str, float], None]]:
    """A listener for (stage, share done) with a bar on standard error; quiet in a pipe or a log."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    console = Console(file=sys.stderr)
    if not console.is_terminal:
        yield lambda stage, share: stop_where_pressed()
        return
    columns = (
        TextColumn("{task.description:<19}"),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
        TextColumn("gone,"),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("reading", total=1.0)

        def tell(stage: str, share: float) -> None:
            stop_where_pressed()
            bar.update(task, description=stage, completed=share)

        yield tell
