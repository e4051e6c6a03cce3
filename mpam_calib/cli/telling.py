"""What several commands say of their results: where the page is, and what is not to be relied on."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path


def tell_page(run: Path, *, kept: bool) -> None:
    """Say where the page of a RUN is, and whether it was there already."""
    print(f"{run / 'report.html'} {'kept (same data, model and options)' if kept else 'written'}")


def warn_unconverged(run: Path) -> None:
    """Say in one line on standard error that the sampling of a RUN did not converge, where it did not."""
    from mpam_calib.posterior.stored import unconverged

    if unconverged(run):
        warn([f"{run} did not converge: its bands may be wrong until it has"])


def warn(lines: Iterable[str]) -> None:
    """Each line on standard error, marked as a warning."""
    for line in lines:
        print(f"warning: {line}", file=sys.stderr)
