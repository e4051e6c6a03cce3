"""Reading a specimen folder: declaration, files, levels, digest."""

from __future__ import annotations

from dataclasses import dataclass, replace
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
from mpam_calib.specimen.recording import (
    BlockedForce,
    Bools,
    FileRead,
    Floats,
    FreeContraction,
    Specimen,
    Tensile,
)
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


@dataclass(frozen=True)
class _Recordings:
    """What a specimen's files hold, and the number of ``rows`` of each file of a kind."""

    loops: LoopsRead | None
    force_map: ForceMapRead | None
    blocked_force: BlockedForce | None
    free_contraction: FreeContraction | None
    tensile: Tensile | None
    rows: dict[FileKind, tuple[int, ...]]

    @property
    def muscle_rows(self) -> int:
        """Rows of all files but those of the bladder's material."""
        return sum(sum(counts) for kind, counts in self.rows.items() if kind != "tensile")

    @property
    def censored(self) -> list[Bools]:
        """Which rows are slack, for each recording of a force."""
        forces = (
            None if self.loops is None else self.loops.loops,
            None if self.force_map is None else self.force_map.force_map,
            self.blocked_force,
        )
        return [part.censored for part in forces if part is not None]


def read_specimen(path: Path, *, data_required: bool = True) -> Specimen:
    """See :func:`mpam_calib.specimen.read`."""
    source = read_toml(path)
    declaration = validate(source)
    simulation = normalised_simulation(source, declaration)
    check_parts(source, declaration, data_required=data_required)
    files = data_files(source, declaration)
    refuse_skipped_headers(source, files)
    found = _read_files(files, declaration)
    if found.tensile is not None:
        label = _of_kind(files, "tensile")[0].label
        check_strains(source, declaration, label, found.tensile, simulation.order + 1)
    levels_Pa, found = _on_common_levels(found)
    loops, force_map = found.loops, found.force_map
    if found.muscle_rows:
        label = next(file.label for file in files if file.kind != "tensile")
        check_rows(label, found.muscle_rows, least_parameters(simulation, len(levels_Pa)))
        _check_pulls(label, levels_Pa, found.censored)
        check_levels(source, simulation, levels_Pa, by_setpoint=loops is not None and loops.by_setpoint)
    return Specimen(
        name=declaration.specimen.name,
        bladder_material=declaration.specimen.bladder_material,
        folder=source.file.parent,
        geometry=declaration.geometry,
        braid=declaration.braid,
        sensors=declaration.sensors,
        simulation=simulation,
        fit=declaration.fit,
        csv=declaration.csv,
        levels_Pa=levels_Pa,
        loops=loops.loops if loops else None,
        force_map=force_map.force_map if force_map else None,
        blocked_force=found.blocked_force,
        free_contraction=found.free_contraction,
        tensile=found.tensile,
        digest=_digest(source, declaration, files),
        notes=(
            *(loops.notes if loops else ()),
            *_overlooked(files),
            *unused(source, declaration, simulation),
        ),
        files=tuple(
            FileRead(file.kind, file.name, count, file.form.delimiter, file.form.decimal)
            for kind, counts in found.rows.items()
            for file, count in zip(_of_kind(files, kind), counts, strict=True)
        ),
        noise=declaration.noise,
        declared_in=source.file,
    )


def _of_kind(files: list[DataFile], kind: FileKind) -> list[DataFile]:
    return [file for file in files if file.kind == kind]


def _read_files(files: list[DataFile], declaration: Declaration) -> _Recordings:
    """Everything that is declared; a muscle's data only beside its geometry."""
    geometry, floor = declaration.geometry, declaration.sensors.force_floor_N
    rows: dict[FileKind, tuple[int, ...]] = {}
    loops = force_map = blocked = free = tensile = None
    if geometry is not None:
        if those := _of_kind(files, "loops"):
            loops = read_loops(those, geometry, floor)
            rows["loops"] = loops.rows
        if those := _of_kind(files, "force_map"):
            force_map = read_force_map(those, geometry, floor)
            rows["force_map"] = force_map.rows
        if those := _of_kind(files, "blocked_force"):
            blocked, rows["blocked_force"] = read_blocked_force(those, geometry, floor)
        if those := _of_kind(files, "free_contraction"):
            free, rows["free_contraction"] = read_free_contraction(those, geometry)
    if those := _of_kind(files, "tensile"):
        tensile, rows["tensile"] = read_tensile(those)
    return _Recordings(loops, force_map, blocked, free, tensile, rows)


def _overlooked(files: list[DataFile]) -> list[str]:
    """A remark for each column that would be read, were it called otherwise (once for all files alike)."""
    found = {(file.kind, written, name): None for file in files for written, name in file.form.overlooked}
    return [
        f'{kind}: the column "{written}" is not read; {name} = "{written}" in [columns.{kind}] would do'
        for kind, written, name in found
    ]


def _on_common_levels(found: _Recordings) -> tuple[Floats, _Recordings]:
    """One list of levels (Pa, sorted), and the recordings with ``level`` indexing it."""
    loops, force_map = found.loops, found.force_map
    if loops is None and force_map is None:
        static = (found.blocked_force, found.free_contraction)
        pressures = [part.pressure_Pa for part in static if part is not None]
        if not pressures:
            return np.zeros(0), found
        together = np.concatenate(pressures)
        return medians_by_label(together, static_levels(together)), found
    nothing = np.zeros(0)
    levels, loop_index, map_index = merge_levels(
        nothing if loops is None else loops.levels_Pa, nothing if force_map is None else force_map.levels_Pa
    )
    if loops is not None:
        loops = replace(loops, loops=replace(loops.loops, level=loop_index[loops.loops.level]))
    if force_map is not None:
        moved = replace(force_map.force_map, level=map_index[force_map.force_map.level])
        force_map = replace(force_map, force_map=moved)
    return levels, replace(found, loops=loops, force_map=force_map)


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
