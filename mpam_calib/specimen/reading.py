"""Reading a specimen folder: declaration, files, levels, digest."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from mpam_calib.errors import InputError
from mpam_calib.specimen.consistency import (
    check_levels,
    check_parts,
    check_rows,
    check_strains,
    least_parameters,
    material_run,
    normalised_simulation,
    unused,
)
from mpam_calib.specimen.declaration import Declaration, FileKind
from mpam_calib.specimen.levels import medians_by_label, merge_levels, static_levels
from mpam_calib.specimen.loops import LoopsRead, read_loops
from mpam_calib.specimen.recording import BlockedForce, Bools, FileRead, Floats, FreeContraction, Specimen
from mpam_calib.specimen.source import DataFile, data_files, digest, refuse_skipped_headers
from mpam_calib.specimen.static_files import (
    ForceMapRead,
    read_blocked_force,
    read_force_map,
    read_free_contraction,
    read_tensile,
)
from mpam_calib.specimen.toml_source import TomlSource, read_toml
from mpam_calib.specimen.validation import validate
from mpam_calib.units import KPA


def read_specimen(path: Path, *, data_required: bool = True) -> Specimen:
    """See :func:`mpam_calib.specimen.read`."""
    source = read_toml(path)
    declaration = validate(source)
    simulation = normalised_simulation(source, declaration)
    check_parts(source, declaration, data_required=data_required)
    files = data_files(source, declaration)
    refuse_skipped_headers(source, files)
    floor = declaration.sensors.force_floor_N
    geometry = declaration.geometry
    rows: dict[FileKind, tuple[int, ...]] = {}

    def of(kind: FileKind) -> list[DataFile]:
        return [file for file in files if file.kind == kind]

    loops = force_map = blocked = free = tensile = None
    if geometry is not None:
        if of("loops"):
            loops = read_loops(of("loops"), geometry, floor)
            rows["loops"] = loops.rows
        if of("force_map"):
            force_map = read_force_map(of("force_map"), geometry, floor)
            rows["force_map"] = force_map.rows
        if of("blocked_force"):
            blocked, rows["blocked_force"] = read_blocked_force(of("blocked_force"), geometry, floor)
        if of("free_contraction"):
            free, rows["free_contraction"] = read_free_contraction(of("free_contraction"), geometry)
    if of("tensile"):
        tensile, rows["tensile"] = read_tensile(of("tensile"))
        check_strains(source, declaration, of("tensile")[0].label, tensile, simulation.order + 1)

    levels_Pa, loops, force_map = _common_levels(loops, force_map, blocked, free)
    muscle_rows = sum(sum(counts) for kind, counts in rows.items() if kind != "tensile")
    if muscle_rows:
        first = next(file for file in files if file.kind != "tensile")
        check_rows(first.label, muscle_rows, least_parameters(simulation, len(levels_Pa)))
        muscle = (
            None if loops is None else loops.loops,
            None if force_map is None else force_map.force_map,
            blocked,
        )
        flags = [part.censored for part in muscle if part is not None]
        _check_pulls(first.label, levels_Pa, flags)
        check_levels(source, simulation, levels_Pa, by_setpoint=loops is not None and loops.by_setpoint)
    return Specimen(
        name=declaration.specimen.name,
        bladder_material=declaration.specimen.bladder_material,
        folder=source.file.parent,
        geometry=geometry,
        braid=declaration.braid,
        sensors=declaration.sensors,
        simulation=simulation,
        fit=declaration.fit,
        csv=declaration.csv,
        levels_Pa=levels_Pa,
        loops=loops.loops if loops else None,
        force_map=force_map.force_map if force_map else None,
        blocked_force=blocked,
        free_contraction=free,
        tensile=tensile,
        digest=_digest(source, declaration, files),
        notes=(
            *(loops.notes if loops else ()),
            *_overlooked(files),
            *unused(source, declaration, simulation),
        ),
        files=tuple(
            FileRead(file.kind, file.name, count, file.form.delimiter, file.form.decimal)
            for kind, counts in rows.items()
            for file, count in zip(of(kind), counts, strict=True)
        ),
        noise=declaration.noise,
        declared_in=source.file,
    )


def _overlooked(files: list[DataFile]) -> list[str]:
    """A remark for each column that would be read, were it called otherwise (once for all files alike)."""
    found = {(file.kind, written, name): None for file in files for written, name in file.form.overlooked}
    return [
        f'{kind}: the column "{written}" is not read; {name} = "{written}" in [columns.{kind}] would do'
        for kind, written, name in found
    ]


def _common_levels(
    loops: LoopsRead | None,
    force_map: ForceMapRead | None,
    blocked: BlockedForce | None,
    free: FreeContraction | None,
) -> tuple[Floats, LoopsRead | None, ForceMapRead | None]:
    """One list of levels (Pa, sorted), and the recordings with ``level`` indexing it."""
    if loops is None and force_map is None:
        pressures = [part.pressure_Pa for part in (blocked, free) if part is not None]
        if not pressures:
            return np.zeros(0), None, None
        together = np.concatenate(pressures)
        return medians_by_label(together, static_levels(together)), None, None
    nothing = np.zeros(0)
    levels, loop_index, map_index = merge_levels(
        nothing if loops is None else loops.levels_Pa, nothing if force_map is None else force_map.levels_Pa
    )
    if loops is not None:
        loops = replace(loops, loops=replace(loops.loops, level=loop_index[loops.loops.level]))
    if force_map is not None:
        moved = replace(force_map.force_map, level=map_index[force_map.force_map.level])
        force_map = replace(force_map, force_map=moved)
    return levels, loops, force_map


def _check_pulls(label: str, levels_Pa: Floats, censored: list[Bools]) -> None:
    """Refuse data without a pressure, or without a force."""
    if levels_Pa[-1] <= 0.0:
        guess = "flipped sign?" if levels_Pa[-1] < 0.0 else "a gauge that is not connected?"
        found = f"no pressure level above {levels_Pa[-1] / KPA:g} kPa ({guess})"
        raise InputError(label, found, "gauge pressures above 0", None, "pressure_kPa")
    if censored and all(flags.all() for flags in censored):
        found = "every row slack (at or below the floor, or censored)"
        raise InputError(label, found, "readings above the floor", None, "force_N")


def _digest(source: TomlSource, declaration: Declaration, files: list[DataFile]) -> str:
    paths = [file.path for file in files]
    if declaration.simulation.moduli.startswith("run:"):
        # Another posterior of the material is another model of the muscle.
        record = material_run(source.file.parent, declaration.simulation) / "run.json"
        paths += [record] if record.is_file() else []
    return digest(source.tables, paths)
