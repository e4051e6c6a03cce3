"""Calibrate every bundled data set that has a specimen.toml, one after another (``make calibrate``).

A data set that does not converge is reported and does not stop the rest. The exit code is 0 unless
one was refused as bad input or crashed.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

HERE = Path(__file__).resolve().parent
REPORTS = HERE.parent / "reports"
DONE, NOT_CONVERGED, INTERRUPTED = 0, 3, 130


def data_sets() -> list[Path]:
    """Folders with a specimen.toml, in order of name."""
    return sorted(path.parent for path in HERE.glob("*/specimen.toml"))


def calibrate(folder: Path, options: list[str]) -> int:
    """Run the command line on one folder and return its exit code."""
    command = [sys.executable, "-m", "mpam_calib", "calibrate", str(folder)]
    return subprocess.run([*command, "-o", str(REPORTS / folder.name), *options], check=False).returncode


def verdict(name: str, code: int) -> str:
    """What became of a data set, in words."""
    if code not in (DONE, NOT_CONVERGED):
        return f"[red]failed (exit code {code})[/red]"
    run = REPORTS / name / "run.json"
    converged = code == DONE
    if run.is_file():
        converged = bool(json.loads(run.read_text(encoding="utf-8")).get("converged", converged))
    return "[green]converged[/green]" if converged else "[yellow]not converged within its budget[/yellow]"


def main(options: list[str]) -> int:
    """Calibrate all, then say where to look; ``options`` are handed on to every run."""
    console = Console()
    table = Table("data set", "outcome", "seconds", "report", title="Calibrated data sets")
    failed = False
    for folder in data_sets():
        console.rule(folder.name)
        start = time.monotonic()
        code = calibrate(folder, options)
        if code in (INTERRUPTED, -2):
            return INTERRUPTED
        failed = failed or code not in (DONE, NOT_CONVERGED)
        report = REPORTS / folder.name / "report.html"
        place = str(report.relative_to(HERE.parent)) if report.is_file() else "none"
        table.add_row(folder.name, verdict(folder.name, code), f"{time.monotonic() - start:.0f}", place)
    console.print(table)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
