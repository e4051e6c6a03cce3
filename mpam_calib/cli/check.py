"""``mpam-calib check``: what a specimen folder holds. Writes nothing."""

from __future__ import annotations

import sys
from typing import TYPE_CHECKING

from mpam_calib.cli.app import app
from mpam_calib.cli.arguments import SpecimenPath

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.console import Console

    from mpam_calib.specimen import Specimen
    from mpam_calib.specimen.recording import ForceMap


@app.command()
def check(
    specimen: SpecimenPath,
) -> None:
    """Print what was read: rows, levels, cycles, branches, speeds, what is missing, what looks odd."""
    from rich.console import Console

    from mpam_calib.specimen import read

    # In a pipe or a log there is no terminal to fit: keep each row of a table on one line. (A closed
    # output is None.)
    width = None if sys.stdout is not None and sys.stdout.isatty() else 120
    report(read(specimen, data_required=False), Console(highlight=False, width=width))


def report(specimen: Specimen, console: Console) -> None:
    """Print the summary of ``specimen`` to ``console``."""
    from mpam_calib.specimen.oddities import oddities

    material = f" ({specimen.bladder_material})" if specimen.bladder_material else ""
    console.print(f"{specimen.name}{material}", style="bold", markup=False)
    simulation = specimen.simulation
    console.print(
        f"simulation: {simulation.kinematics}, {simulation.strain} strain, friction {simulation.friction}, "
        f"moduli {simulation.moduli}, order {simulation.order}, law {simulation.law}, "
        f"effects {', '.join(simulation.effects) or 'none'}",
        markup=False,
    )
    _files(specimen, console)
    if specimen.loops is not None:
        _loops(specimen, console)
    _other_levels(specimen, console)
    _list("not there", _missing(specimen), console)
    _list("odd", oddities(specimen), console)


def _files(specimen: Specimen, console: Console) -> None:
    from rich.markup import escape
    from rich.table import Table

    table = Table("file", "kind", "rows", "delimiter", "decimal")
    for file in specimen.files:
        delimiter = "tab" if file.delimiter == "\t" else file.delimiter
        table.add_row(escape(file.name), file.kind, f"{file.rows}", delimiter, file.decimal)
    if specimen.files:
        console.print(table)


def _loops(specimen: Specimen, console: Console) -> None:
    from rich.table import Table

    from mpam_calib.specimen.summary import summarise_loops

    assert specimen.loops is not None and specimen.geometry is not None
    summary = summarise_loops(specimen.loops, specimen.levels_Pa, specimen.geometry.L0)
    table = Table("level kPa", "sd kPa", "rows", "cycles", "branches", "mm/min", "contraction", "force N")
    for level in summary.levels:
        table.add_row(
            f"{level.pressure_kPa:.4g}",
            f"{level.pressure_sd_kPa:.2g}",
            f"{level.rows}",
            f"{level.cycles}",
            ", ".join(level.branches),
            _some(f"{speed:.3g}" for speed in level.speeds_mm_per_min),
            f"{level.contraction[0]:.3f} to {level.contraction[1]:.3f}",
            f"{level.force_N[0]:.4g} to {level.force_N[1]:.4g}",
        )
    console.print(table)
    rates = _some(f"{rate:.3g}" for rate in summary.sampling_Hz)
    console.print(f"sampling: {rates or 'unknown'} Hz; noise of one force reading: {summary.noise_N:.2g} N")


def _other_levels(specimen: Specimen, console: Console) -> None:
    from mpam_calib.units import KPA

    if specimen.force_map is not None or (specimen.loops is None and len(specimen.levels_Pa)):
        levels = _some((f"{level / KPA:.4g}" for level in specimen.levels_Pa), 40)
        console.print(f"levels: {levels} kPa")
    if specimen.force_map is not None:
        lengths = {round(float(value), 3) for value in specimen.force_map.contraction}
        console.print(f"force map: {len(lengths)} contractions, {min(lengths):.3f} to {max(lengths):.3f}")
    if specimen.tensile is not None:
        strain = specimen.tensile.strain
        console.print(f"tensile: strain {strain.min():.3g} to {strain.max():.3g}")


def _missing(specimen: Specimen) -> list[str]:
    """Optional parts that are not there, and what they would tell."""
    missing = []
    if not specimen.files:
        missing.append("data files: only simulate can use this specimen")
    if specimen.geometry is not None and specimen.loops is None:
        # A force map read on the way there and back tells friction by itself.
        untold = "history" if _both_branches(specimen.force_map) else "friction and history"
        missing.append(f"loops: {untold} cannot be told")
    if specimen.loops is not None and specimen.blocked_force is None:
        missing.append("blocked_force: a threshold in it would identify the dead-band")
    if specimen.tensile is None and specimen.simulation.moduli == "loops" and specimen.has_muscle_data:
        missing.append("tensile: the material's own test would separate moduli from static effects")
    if specimen.braid is None and specimen.geometry is not None:
        missing.append(
            "[braid]: braid_stretch and strand friction cannot be declared; where diagnose names one, "
            "its size is stated for nylon strands that it assumes"
        )
    if specimen.geometry is not None and specimen.sensors.force_sd_N is None:
        missing.append("[sensors] force_sd_N: the noise is estimated from the data alone")
    return missing


def _both_branches(force_map: ForceMap | None) -> bool:
    from mpam_calib.specimen.recording import LOADING, UNLOADING

    return force_map is not None and {LOADING, UNLOADING} <= set(force_map.branch.tolist())


def _list(title: str, lines: list[str], console: Console) -> None:
    if lines:
        console.print(f"{title}:")
    for line in lines:
        console.print(f"  - {line}", markup=False)


def _some(words: Iterable[str], limit: int = 4) -> str:
    every = list(words)
    return ", ".join(every[:limit]) + (f", ... ({len(every)})" if len(every) > limit else "")
