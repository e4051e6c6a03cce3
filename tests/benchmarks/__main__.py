"""Time the package, nutpie and PyMC on one posterior, each in a process of its own, and print the table."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mpam_calib.posterior.chains.convergence import diagnose_chains
from mpam_calib.posterior.chains.effective import ess_bulk

from .problem import NAMES, as_rows, specimen

Array = NDArray[np.float64]

WANTED = 4000
DENSER = "ten times the readings a second"
DRAWS = 2000
"""Draws of each of the others' chains."""


@dataclass(frozen=True)
class Outcome:
    """A finished job: its draws, their effective size, and what the process took (seconds, MiB)."""

    figures: Array
    ess: float
    sampling: tuple[float, float]
    process: tuple[float, float]
    memory: float

    @property
    def rates(self) -> tuple[float, float]:
        """ESS of the worst parameter per second and per processor second of sampling."""
        return self.ess / self.sampling[0], self.ess / self.sampling[1]

    def to_wanted(self, scaled: bool) -> tuple[float, float]:
        """Seconds, and processor seconds, from the start of the process to the effective size wanted.

        ``scaled``: as if it had stopped there; else as it did stop by itself.
        """
        if not scaled:
            return self.process
        share = 1.0 - WANTED / self.ess
        return self.process[0] - share * self.sampling[0], self.process[1] - share * self.sampling[1]


def launch(job: str, folder: Path) -> Outcome:
    """Run a job and wait for it; memory is that of its largest process."""
    print(f"  {job} ...", file=sys.stderr, flush=True)
    start = time.perf_counter()
    log = folder / "log"
    with log.open("w") as output:
        process = subprocess.Popen(
            [sys.executable, "-W", "ignore", "-m", "benchmarks.work", job, str(folder)],
            stdout=output,
            stderr=output,
            env={**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        )
        _, status, usage = os.wait4(process.pid, 0)
    wall = time.perf_counter() - start
    if status:
        raise SystemExit(f"{job} failed:\n{log.read_text()}")
    with np.load(folder / f"{job}.npz") as stored:
        figures, took = stored["figures"], stored["took"].tolist()
    return Outcome(
        figures,
        _effective(figures),
        (took[0], took[1]),
        (wall, usage.ru_utime + usage.ru_stime),
        took[2],
    )


def _effective(figures: Array) -> float:
    """ArviZ's bulk ESS of the worst parameter; for ensembles the smaller of it and emcee's N/τ."""
    import arviz as az

    if figures.shape[2] > 1:
        return float(diagnose_chains(figures).ess_bulk.min())
    return min(float(az.ess(figures[:, :, 0, i], method="bulk")) for i in range(len(NAMES)))


def disagreement(one: Outcome, other: Outcome) -> tuple[float, float]:
    """Largest difference of means, and of sds, in Monte Carlo errors."""
    worst = [0.0, 0.0]
    for i in range(len(NAMES)):
        found = [_moments(outcome.figures[..., i]) for outcome in (one, other)]
        for j in range(2):
            difference = abs(found[0][j][0] - found[1][j][0])
            worst[j] = max(worst[j], difference / np.hypot(found[0][j][1], found[1][j][1]))
    return worst[0], worst[1]


def _moments(x: Array) -> tuple[tuple[float, float], tuple[float, float]]:
    """Mean and sd of draws (ensembles, steps, walkers), each with its Monte Carlo error."""
    chains = np.moveaxis(x, 2, 1).reshape(-1, x.shape[1])
    mean, sd = float(x.mean()), float(x.std())
    squares = (chains - mean) ** 2
    error = float(squares.std()) / np.sqrt(ess_bulk(squares)) / (2.0 * sd)
    return (mean, sd / np.sqrt(ess_bulk(chains))), (sd, error)


def line(name: str, outcome: Outcome, times: tuple[float, float], ours: Outcome | None, at: float) -> str:
    """A row of the table."""
    rate, per_cpu = outcome.rates
    beside = "–" if ours is None else f"{ours.rates[0] / rate:.1f} / {ours.rates[1] / per_cpu:.1f}"
    faster = "–" if ours is None else f"{times[0] / at:.1f}"
    return (
        f"| {name} | {outcome.ess:,.0f} | {rate:,.0f} | {per_cpu:,.0f} | {times[0]:.1f} | {times[1]:.1f} "
        f"| {outcome.memory:.0f} | {beside} | {faster} |"
    )


def main() -> None:
    """All jobs, the table, the agreement, and the targets."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        as_rows(specimen()).save(folder / "rows.npz")
        short = launch(f"ours white {WANTED} 1800 1", folder)
        ours = launch(f"ours white {10 * WANTED} 1800 1", folder)
        short_full = launch(f"ours full {WANTED} 1800 1", folder)
        full = launch(f"ours full {10 * WANTED} 1800 1", folder)
        for library in ("nutpie", "pymc"):
            launch(f"{library} rows 10", folder)  # fills their caches of compiled code
        others = {
            f"{library}, {label}": launch(f"{library} {kind} {DRAWS}", folder)
            for kind, label in (("rows", "all rows"), ("statistics", "sufficient statistics"))
            for library in ("nutpie", "pymc")
        }
        more = {
            DENSER: launch(f"ours white {10 * WANTED} 18000 1", folder),
            "ten cycles": launch(f"ours white {10 * WANTED} 1800 10", folder),
        }
        more_full = {DENSER: launch(f"ours full {10 * WANTED} 18000 1", folder)}
    libraries = ", ".join(
        f"{n} {version(n)}" for n in ("emcee", "nutpie", "pymc", "pytensor", "numba", "numpy", "arviz")
    )
    print(f"{os.cpu_count()} cores, Python {platform.python_version()}, {libraries}; 18,000 rows\n")
    print(
        f"| sampler | ESS | ESS/s | ESS per CPU s | s to {WANTED:,} | CPU s to {WANTED:,} | peak MiB "
        "| ours faster: ESS/s / per CPU s | ours faster: to 4,000 |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    start = short.process[0]
    print(line("mpam-calib, white noise", ours, short.process, None, start))
    for name, outcome in others.items():
        print(line(name, outcome, outcome.to_wanted(scaled=True), ours, start))
    print(line("mpam-calib, correlated noise and remainder", full, short_full.process, None, start))
    print("\nLargest disagreement with ours, in Monte Carlo errors (means; sds; 11 parameters each):")
    for name, outcome in others.items():
        print("  {}: {:.1f}; {:.1f}".format(name, *disagreement(ours, outcome)))
    print("\n180,000 rows beside 18,000, sampling seconds for one ESS (wall; CPU):")
    for label, base, found in (("white noise", ours, more), ("correlated, remainder", full, more_full)):
        for name, outcome in found.items():
            ratios = [base.rates[i] / outcome.rates[i] for i in range(2)]
            print(f"  {label}, {name}: {ratios[0]:.2f}; {ratios[1]:.2f}, peak {outcome.memory:.0f} MiB")
    _targets(ours, (short, short_full), full, others, more, more_full)


def _targets(
    ours: Outcome,
    to_wanted: tuple[Outcome, Outcome],
    full: Outcome,
    others: dict[str, Outcome],
    more: dict[str, Outcome],
    more_full: dict[str, Outcome],
) -> None:
    """Measured beside wanted. Memory is that of runs to the size wanted; the table has the long runs'."""
    short = to_wanted[0]
    rows = [outcome for name, outcome in others.items() if name.endswith("rows")]
    rate = ours.rates[0] / max(outcome.rates[0] for outcome in rows)
    per_cpu = ours.rates[1] / max(outcome.rates[1] for outcome in rows)
    sooner = min(outcome.to_wanted(scaled=True)[0] for outcome in rows) / short.process[0]
    sooner_cpu = min(outcome.to_wanted(scaled=True)[1] for outcome in rows) / short.process[1]
    growth = max(
        *(ours.rates[1] / outcome.rates[1] for outcome in more.values()),
        full.rates[1] / more_full[DENSER].rates[1],
    )
    largest = max(outcome.memory for outcome in to_wanted)
    print("\n| target | wanted | measured |\n|---|---|---|")
    print(
        f"| ESS/s beside the better of the others, all rows | >= 5 | {rate:.1f} (per CPU s {per_cpu:.1f}) |"
    )
    print(f"| seconds to {WANTED:,}, theirs over ours | >= 3 | {sooner:.1f} (CPU s {sooner_cpu:.1f}) |")
    print(
        f"| ESS/s with correlated noise and remainder | >= 1,000 "
        f"| {full.rates[0]:,.0f} (per CPU s {full.rates[1]:,.0f}) |"
    )
    longest = max(ours.memory, full.memory)
    print(f"| peak memory to {WANTED:,}, MiB | <= 300 | {largest:.0f} (long runs {longest:.0f}) |")
    print(f"| CPU seconds of sampling, 180,000 rows over 18,000 | <= 1.2 | {growth:.2f} |")


if __name__ == "__main__":
    main()
