"""``diagnose`` from a specimen folder to a RUN folder: diagnosis.json, extended/, report.html."""

from __future__ import annotations

import shutil
from pathlib import Path

import tomlkit

from mpam_calib.criticism.diagnose import Diagnosis, Tell, describe, diagnose, extended_effects
from mpam_calib.criticism.journal import Journal
from mpam_calib.posterior.checkpoint import write_atomically
from mpam_calib.posterior.material import keep_material, material_of
from mpam_calib.posterior.stored import RUN_FILE
from mpam_calib.report.diagnosis import diagnosis_page
from mpam_calib.run.files import demand_folder, write_json
from mpam_calib.run.folder import run_digest
from mpam_calib.run.kept import Kept
from mpam_calib.specimen import read
from mpam_calib.specimen.recording import Specimen

FILES = ("diagnosis.json", "report.html", "extended/specimen.toml")


def diagnose_to_folder(
    source: Path, run: Path, *, seed: int = 0, tell: Tell | None = None
) -> Diagnosis | None:
    """Diagnose a specimen into a RUN folder; None where it is kept, since it holds the same already.

    Raises ``InputError`` before anything is written.
    """
    specimen = read(source)
    demand_folder(run, replaces=RUN_FILE)
    material = material_of(specimen)
    digest = run_digest(specimen.digest, command="diagnose", seed=seed, material=material)
    kept = Kept(run, digest, FILES)
    if kept.finished():
        return None
    found = diagnose(specimen, material=material, tell=tell, journal=Journal(kept.unfinished))
    kept.begin()
    toml = source / "specimen.toml" if source.is_dir() else source
    write_extended(found, specimen, toml, run / "extended")
    content = describe(found, seed)
    diagnosis_page(found, content, specimen).write(run / "report.html")
    write_json(content, run / "diagnosis.json")
    kept.finish()
    return found


def write_extended(found: Diagnosis, specimen: Specimen, toml: Path, folder: Path) -> None:
    """The specimen with the causes among its effects, its data files beside it: ``calibrate`` takes it."""
    document = tomlkit.parse(toml.read_text(encoding="utf-8-sig"))
    simulation = document.setdefault("simulation", tomlkit.table())
    simulation["effects"] = list(extended_effects(found))
    keep_material(document, specimen, folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for file in specimen.files:
        destination = folder / file.name
        destination.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(specimen.folder / file.name, destination)
    text = tomlkit.dumps(document)
    write_atomically(folder / "specimen.toml", lambda p: p.write_text(text, encoding="utf-8"))
