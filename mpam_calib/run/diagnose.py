"""``diagnose`` from a specimen folder to a RUN folder: diagnosis.json, extended/, report.html."""

from __future__ import annotations

import shutil
from pathlib import Path

import tomlkit

from mpam_calib.atomic_files import write_atomically
from mpam_calib.criticism.diagnose import Diagnosis, Tell, describe, diagnose, extended_effects
from mpam_calib.criticism.tasks.journal import Journal
from mpam_calib.errors import InputError
from mpam_calib.model.effect import known_effects
from mpam_calib.posterior.material import demand_other, keep_material, material_of
from mpam_calib.posterior.stored import RUN_FILE
from mpam_calib.report.diagnosis import diagnosis_page
from mpam_calib.run.files import KEPT_FILE, UNFINISHED, demand_forces, demand_own, demand_writable, write_json
from mpam_calib.run.folder import run_digest
from mpam_calib.run.kept import Kept
from mpam_calib.run.provenance import provenance
from mpam_calib.run.replaced import tell_replaced
from mpam_calib.specimen import read
from mpam_calib.specimen.recording import Specimen
from mpam_calib.specimen.toml_source import SPECIMEN_FILE, declaration_of

EXTENDED = "extended"
FILES = ("diagnosis.json", "report.html", f"{EXTENDED}/{SPECIMEN_FILE}")


def diagnose_to_folder(
    source: Path, run: Path, *, seed: int = 0, tell: Tell | None = None
) -> Diagnosis | None:
    """Diagnose a specimen into a RUN folder; None where it is kept, since it holds the same already.

    What an interruption has left is gone on with. Raises ``InputError`` before anything is written.
    """
    specimen = read(source)
    demand_own(run, RUN_FILE, KEPT_FILE)
    demand_other(specimen, run)
    material = material_of(specimen)
    digest = run_digest(specimen, searched=known_effects(), command="diagnose", seed=seed, material=material)
    files = (*FILES, *(f"{EXTENDED}/{file.name}" for file in specimen.files))
    kept = Kept(run, "diagnose", digest, files)
    if kept.finished():
        return None
    demand_writable(run)
    _demand_extended(source, run, files)
    demand_forces(specimen, "one to diagnose")
    tell_replaced(run, "diagnosis")
    with kept.unfinished.resumable():
        found = diagnose(specimen, material=material, tell=tell, journal=Journal(kept.unfinished))
    kept.begin()
    write_extended(found, specimen, declaration_of(source), run / EXTENDED)
    content = describe(found, seed)
    diagnosis_page(found, content, specimen).under(provenance(specimen)).write(run / "report.html")
    write_json(content, run / "diagnosis.json")
    kept.finish()
    return found


def _demand_extended(source: Path, run: Path, files: tuple[str, ...]) -> None:
    """Raise ``InputError`` where the extended specimen would be written over another, or its own source."""
    extended = run / EXTENDED
    if declaration_of(source).parent.resolve().is_relative_to(extended.resolve()):
        raise InputError(run, f"the folder whose {EXTENDED}/ is diagnosed", "another for these results")
    own = any((run / name).exists() for name in (KEPT_FILE, UNFINISHED))
    others = any((run / name).exists() for name in files if name.startswith(f"{EXTENDED}/"))
    if others and not own:
        raise InputError(extended, "a specimen that no diagnosis wrote", "another folder for these results")


def write_extended(found: Diagnosis, specimen: Specimen, toml: Path, folder: Path) -> None:
    """The specimen with the causes among its effects, its data files beside it: ``calibrate`` takes it."""
    document = tomlkit.parse(toml.read_text(encoding="utf-8-sig"))
    simulation = document.setdefault("simulation", tomlkit.table())
    simulation["effects"] = list(extended_effects(found))
    if found.leant_on is not None:
        strands = tomlkit.table()
        strands.add(tomlkit.comment("assumed, not measured: what needs it has its size for these strands"))
        for key, value in found.leant_on.model_dump().items():
            strands.add(key, value)
        document["braid"] = strands
    keep_material(document, specimen, folder)
    folder.mkdir(parents=True, exist_ok=True)
    for file in specimen.files:
        destination = folder / file.name
        destination.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(specimen.folder / file.name, destination)
    text = tomlkit.dumps(document)
    write_atomically(folder / SPECIMEN_FILE, lambda p: p.write_text(text, encoding="utf-8"))
