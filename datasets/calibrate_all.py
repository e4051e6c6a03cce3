"""Calibrate every bundled data set that has a specimen.toml, one after another (``make calibrate``).

    python datasets/calibrate_all.py [NAME ...] [options of mpam-calib calibrate]

A finished run of the same data, model, options and versions is kept. A data set that does not converge,
is refused or crashes is reported and does not stop the rest. The exit code is 0 unless one was refused or
crashed.
"""

from __future__ import annotations

import csv
import html
import json
import re
import resource
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.table import Table

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent
REPORTS = ROOT / "reports"
DONE, BAD_INPUT, NOT_CONVERGED, INTERRUPTED = 0, 2, 3, 130
COLOURS = {"good": "green", "caution": "yellow", "bad": "red"}
VERDICT = re.compile(
    r'<div class="verdict (\w+)">\s*<p class="sentence">(?:<span.*?</span>)?(.*?)</p>', re.DOTALL
)


@dataclass(frozen=True)
class Ended:
    """How one run ended: exit code, seconds by the clock and of the processor, whether it was kept."""

    code: int
    seconds: float
    cpu: float
    kept: bool


def data_sets(wanted: list[str]) -> list[Path]:
    """Folders with a specimen.toml, in order of name; only the ``wanted`` ones where some are named."""
    found = sorted(path.parent for path in HERE.glob("*/specimen.toml"))
    return [folder for folder in found if not wanted or folder.name in wanted]


def calibrate(folder: Path, options: list[str]) -> Ended:
    """Run the command line on one folder."""
    command = [sys.executable, "-m", "mpam_calib", "calibrate", str(folder), "-o", str(REPORTS / folder.name)]
    start, used = time.monotonic(), _cpu_of_children()
    done = subprocess.run([*command, *options], check=False, stdout=subprocess.PIPE, text=True)
    seconds, cpu = time.monotonic() - start, _cpu_of_children() - used
    return Ended(done.returncode, seconds, cpu, kept=" kept " in done.stdout)


def _cpu_of_children() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def outcome(run: Path, ended: Ended) -> str:
    """What became of a data set, in words: the report's own verdict where there is one."""
    if ended.code == BAD_INPUT:
        return "[red]refused as bad input: see the line above[/red]"
    if ended.code not in (DONE, NOT_CONVERGED):
        return f"[red]crashed (exit code {ended.code})[/red]"
    words = "" if ended.code == DONE else "[red]Not converged within its budget.[/red] "
    page = _or_nothing(lambda: (run / "report.html").read_text(encoding="utf-8"))
    found = VERDICT.search(page)
    if found is None:
        return words or "[green]converged[/green]"
    sentence = html.unescape(re.sub(r"<[^>]*>", "", found.group(2))).strip()
    colour = COLOURS.get(found.group(1), "default")
    return f"{words}[{colour}]{escape(sentence)}[/{colour}]"


def headline(run: Path) -> str:
    """Blocked force with its 90 % band at the highest level, or the stress at the largest strain."""
    with (run / "bands.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for quantity, key, scale, words in (
        ("blocked_force_N", "pressure_kPa", 1.0, "{} N ({} to {}) at {:g} kPa"),
        ("stress_Pa", "contraction", 1e-3, "{} kPa ({} to {}) at a strain of {:g}"),
    ):
        levels = [row for row in rows if row["quantity"] == quantity]
        if levels:
            row = max(levels, key=lambda row: float(row[key]))
            band = (f"{scale * float(row[name]):.4g}" for name in ("mean", "q05", "q95"))
            return words.format(*band, float(row[key]))
    return ""


def _or_nothing(read: Callable[[], str]) -> str:
    """What could be read of a run; nothing of one that is not there or not whole."""
    try:
        return read()
    except (OSError, ValueError, KeyError):
        return ""


def draws(run: Path) -> str:
    """How sampling ended, for one that did not converge."""
    state = json.loads((run / "run.json").read_text(encoding="utf-8"))["sampling"]
    ess = min(state["ess_bulk_min"], state["ess_tail_min"])
    return f"{state['steps']} steps, R-hat {state['rhat_max']:.3f}, ESS {ess:.0f}"


def main(arguments: list[str]) -> int:
    """Calibrate all, then say where to look; options are handed on to every run."""
    names = {path.parent.name for path in HERE.glob("*/specimen.toml")}
    wanted = [word for word in arguments if word in names]
    options = [word for word in arguments if word not in names]
    # In a pipe or a log there is no window to fit.
    console = Console(highlight=False, width=None if sys.stdout.isatty() else 140)
    table = Table(title="Calibrated data sets", title_justify="left", show_lines=True)
    for column in ("data set", "result (90 % band)", "verdict"):
        table.add_column(column, overflow="fold")
    for column in ("time", "processor"):
        table.add_column(column, justify="right", no_wrap=True)
    runs: list[Ended] = []
    try:
        for folder in data_sets(wanted):
            run = REPORTS / folder.name
            console.rule(folder.name)
            ended = calibrate(folder, options)
            if ended.code in (INTERRUPTED, -2):
                raise KeyboardInterrupt
            runs.append(ended)
            usable = ended.code in (DONE, NOT_CONVERGED)
            number = _or_nothing(lambda run=run: headline(run)) if usable else ""
            words = outcome(run, ended)
            if ended.code == NOT_CONVERGED:
                words += f" ({_or_nothing(lambda run=run: draws(run))})"
            took = "kept" if ended.kept else f"{ended.seconds:.0f} s"
            console.print(f"{took}: {words}")
            table.add_row(folder.name, number, words, took, f"{ended.cpu:.0f} s")
    except KeyboardInterrupt:
        console.print("interrupted: finished runs are kept, the same command goes on from here")
        return INTERRUPTED
    console.print(table)
    total, cpu = sum(ended.seconds for ended in runs), sum(ended.cpu for ended in runs)
    console.print(f"{total:.0f} s in all ({cpu:.0f} s of processor time).")
    console.print("Open the reports in a browser:")
    for path in sorted(REPORTS.glob("*/report.html")):
        if path.parent.name in names:
            console.print(f"  {path.relative_to(ROOT)}", soft_wrap=True)
    failed = [ended for ended in runs if ended.code not in (DONE, NOT_CONVERGED)]
    if failed:
        console.print(f"[red]{len(failed)} of {len(runs)} could not be calibrated[/red]; see above.")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
