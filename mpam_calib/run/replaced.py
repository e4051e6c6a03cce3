"""A folder holds one page: whose page a command is about to replace is told as soon as it will not refuse."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from mpam_calib.posterior.stored import RUN_FILE
from mpam_calib.run.files import KEPT_FILE
from mpam_calib.run.kept import written_over

PAGE = "report.html"


def tell_replaced(folder: Path, own: str) -> None:
    """Say in one line on standard error that another command's page goes; ``own`` as :func:`page_owner`."""
    owner = page_owner(folder)
    if owner is not None and owner != own:
        print(f"note: {folder / PAGE} is of a {owner}; this {own} will replace it", file=sys.stderr)


def page_owner(folder: Path) -> str | None:
    """What the page of a folder shows: a calibration, diagnosis or selection; None where there is none."""
    page = folder / PAGE
    if not page.is_file():
        return None
    if not written_over(page):
        return "calibration" if (folder / RUN_FILE).exists() else None
    files = json.loads((folder / KEPT_FILE).read_text(encoding="utf-8"))["files"]
    return "diagnosis" if "diagnosis.json" in files else "selection"
