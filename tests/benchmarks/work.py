"""One sampler in a process of its own: ``python -m benchmarks.work JOB FOLDER``."""

from __future__ import annotations

import resource
import sys
from pathlib import Path

import numpy as np

from .stopwatch import Drawn


def run(job: str, folder: Path) -> Drawn:
    """Draw for a job: "nutpie rows 2000" (draws of a chain), "ours white 4000 1800 1" (ESS, rows, cycles)."""
    who, what, *numbers = job.split()
    if who != "ours":
        from .competitors import draw as draw_with
        from .rows import Rows

        rows = Rows.load(folder / "rows.npz")
        return draw_with(who, rows, reduced=what == "statistics", draws=int(numbers[0]))
    from .ours import draw
    from .problem import FULL, WHITE_ONLY, specimen

    ess, rows, cycles = (int(number) for number in numbers)
    full = what == "full"
    return draw(specimen(rows, cycles, correlated=full), FULL if full else WHITE_ONLY, ess, 2 if full else 1)


def peak_memory() -> float:
    """MiB of this process at its largest, or of a child of it that was larger."""
    with open("/proc/self/status", encoding="ascii") as status:
        own = next(float(line.split()[1]) for line in status if line.startswith("VmHWM"))
    return max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) / 1024.0


if __name__ == "__main__":
    job, folder = sys.argv[1], Path(sys.argv[2])
    drawn = run(job, folder)
    np.savez(folder / f"{job}.npz", figures=drawn.figures, took=[drawn.wall, drawn.cpu, peak_memory()])
