"""One calibration's folder: posterior.nc, summary.csv, bands.csv, run.json, report.html."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomlkit

from mpam_calib.arviz_import import import_arviz
from mpam_calib.calibration import Calibration
from mpam_calib.errors import InputError
from mpam_calib.model.blueprint import Blueprint, MaterialPosterior
from mpam_calib.model.model import Model, build_model
from mpam_calib.posterior.checkpoint import Checkpoint, sweep, write_atomically
from mpam_calib.posterior.draws import Draws, reported
from mpam_calib.run.files import RUN_FILE, write_csv, write_json
from mpam_calib.run.kept import written_over
from mpam_calib.specimen.recording import Specimen

REPORT = "report.html"
WRITTEN = (RUN_FILE, "posterior.nc", "summary.csv", "bands.csv", REPORT)
"""What a finished calibration leaves."""
DERIVED = ("predictions.csv", "designs.csv", "designs.html")
"""What later commands add, and what goes when the posterior they came from goes."""
NO_TEST = (0.0, 0.0)
"""The strain range of moduli that no tensile test gave."""
PACKAGES = ("mpam-calib", "arviz", "emcee", "numpy", "scipy", "pandas")


def versions() -> dict[str, str]:
    """Versions of what a result depends on."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def run_digest(specimen_digest: str, **options: Any) -> str:
    """SHA-256 over data, model, options and versions: what decides whether a RUN can be kept."""
    content = json.dumps([specimen_digest, options, versions()], sort_keys=True, default=str)
    return hashlib.sha256(content.encode()).hexdigest()


@dataclass(frozen=True)
class RunFolder:
    """A RUN folder and the digest of what it should hold."""

    path: Path
    digest: str

    @property
    def checkpoint(self) -> Checkpoint:
        """Where an unfinished run keeps its blocks."""
        return Checkpoint(self.path / "checkpoint", self.digest)

    def state(self) -> dict[str, Any] | None:
        """``run.json`` where it belongs to this digest, else None."""
        try:
            content: dict[str, Any] = json.loads((self.path / RUN_FILE).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return content if content.get("digest") == self.digest else None

    def complete(self) -> bool:
        """Whether all that a finished calibration leaves is there, its own page too, and can be read."""
        there = all((self.path / name).is_file() for name in WRITTEN)
        return there and not written_over(self.path / REPORT) and _readable(self.path / "posterior.nc")

    def clear(self) -> None:
        """Remove an older run's results, the mark of a finished run first, and what was left half-written."""
        self.path.mkdir(parents=True, exist_ok=True)
        for name in (*WRITTEN, *DERIVED):
            (self.path / name).unlink(missing_ok=True)
        sweep(self.path)

    def write(self, calibration: Calibration, bands: pd.DataFrame) -> None:
        """Write everything but the report; ``run.json`` comes last, as the mark of a finished run."""
        write_csv(calibration.summary, self.path / "summary.csv")
        write_csv(bands, self.path / "bands.csv")
        write_posterior(calibration, self.path / "posterior.nc")
        write_json(describe(calibration, self.digest), self.path / RUN_FILE)


def _readable(posterior: Path) -> bool:
    """Whether every array of the file can be read."""
    import h5netcdf

    try:
        with h5netcdf.File(posterior, "r") as file:
            for group in file.groups.values():
                for variable in group.variables.values():
                    _ = variable[...]
    except (OSError, RuntimeError, ValueError, KeyError):
        return False
    return True


def describe(calibration: Calibration, digest: str) -> dict[str, Any]:
    """The content of ``run.json``: no times, no paths."""
    sampling, specimen = calibration.sampling, calibration.specimen
    ensembles, steps, walkers, dimensions = sampling.chain.shape
    summary = calibration.summary
    return {
        "format": 1,
        "digest": digest,
        "specimen_digest": specimen.digest,
        "converged": calibration.converged,
        "seed": calibration.seed,
        "versions": versions(),
        "specimen": {"name": specimen.name, "bladder_material": specimen.bladder_material},
        "blueprint": calibration.model.blueprint.model_dump(mode="json"),
        "sampling": {
            "ensembles": ensembles,
            "walkers": walkers,
            "steps": steps,
            "cut": sampling.cut,
            "parameters": list(calibration.model.names),
            "dimensions": dimensions,
            "acceptance": round(sampling.acceptance, 6),
            "warm_up_acceptance": [round(a, 6) for a in sampling.warm_up_acceptance],
            "ess_wanted": calibration.ess_wanted,
            "rhat_max": round(float(summary["rhat"].max()), 6),
            "ess_bulk_min": round(float(summary["ess_bulk"].min()), 3),
            "ess_tail_min": round(float(summary["ess_tail"].min()), 3),
            "modes": [
                {"log_posterior": round(m.log_posterior, 6), "log_evidence": round(m.log_evidence, 6)}
                for m in sampling.modes
            ],
        },
    }


def write_posterior(calibration: Calibration, path: Path) -> None:
    """ArviZ InferenceData, chain = ensemble: reported quantities in lab units, and what predictions need."""
    az = import_arviz()

    draws, chains = calibration.draws, calibration.draws.chains
    posterior = {item.name: item.draws.reshape(chains, -1) for item in calibration.reported}
    shape = (chains, len(draws) // chains)
    sampler = {
        "coordinates": draws.u.reshape(*shape, -1),
        "linear_coordinates": draws.eta.reshape(*shape, -1),
    }
    assert draws.index is not None
    log_prob = calibration.sampling.log_prob.reshape(chains, -1)[:, draws.index]
    data = az.from_dict(
        posterior=posterior,
        sample_stats={"lp": log_prob},
        attrs={"inference_library": "emcee", "digest": calibration.specimen.digest},
    )
    coordinates = az.dict_to_dataset(sampler, library=None)
    data.add_groups({"sampler_coordinates": coordinates}, warn_on_custom_groups=False)
    for group in data.groups():
        # A time of writing would make two equal runs differ.
        data[group].attrs.pop("created_at", None)
        data[group].attrs.setdefault("digest", calibration.specimen.digest)
    write_atomically(path, lambda p: data.to_netcdf(str(p), engine="h5netcdf"))


@dataclass(frozen=True)
class StoredRun:
    """A finished RUN, ready to predict."""

    path: Path
    model: Model
    draws: Draws
    state: dict[str, Any]

    @property
    def seed(self) -> int:
        """The seed that the run was made with."""
        return int(self.state["seed"])


def load_run(path: Path) -> StoredRun:
    """Read a RUN folder; raises ``InputError`` where it is none or is not finished."""
    az = import_arviz()

    try:
        state: dict[str, Any] = json.loads((path / RUN_FILE).read_text(encoding="utf-8"))
        blueprint = Blueprint.model_validate(state["blueprint"])
    except (OSError, ValueError, KeyError) as error:
        raise InputError(path / RUN_FILE, "no finished run", "a folder that calibrate wrote") from error
    try:
        data = az.from_netcdf(str(path / "posterior.nc"), engine="h5netcdf")
        stored = data["sampler_coordinates"]
        u, eta = stored["coordinates"].to_numpy(), stored["linear_coordinates"].to_numpy()
    except (OSError, RuntimeError, ValueError, KeyError) as error:
        found = "a damaged file" if (path / "posterior.nc").is_file() else "no such file"
        raise InputError(path / "posterior.nc", found, "the draws that calibrate wrote") from error
    model = build_model(blueprint)
    u, eta, chains = u.reshape(-1, u.shape[-1]), eta.reshape(-1, eta.shape[-1]), u.shape[0]
    return StoredRun(path, model, Draws(u, model.values(u), eta, chains), state)


def unconverged(path: Path) -> bool:
    """Whether a RUN says of itself that its sampling did not converge."""
    try:
        state: dict[str, Any] = json.loads((path / RUN_FILE).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return state.get("converged") is False


def material_folder(specimen: Specimen) -> Path | None:
    """The RUN that ``moduli = "run:PATH"`` names (relative to the specimen's folder), if it does."""
    moduli = specimen.simulation.moduli
    if not moduli.startswith("run:"):
        return None
    return (specimen.folder / moduli.removeprefix("run:").strip()).resolve()


def keep_material(document: tomlkit.TOMLDocument, specimen: Specimen, folder: Path) -> None:
    """Let a specimen's declaration find the RUN of its moduli from another folder."""
    if (target := material_folder(specimen)) is not None:
        document["simulation"]["moduli"] = f"run:{os.path.relpath(target, folder.resolve())}"


def material_of(path: Path) -> MaterialPosterior:
    """The moduli that a RUN found, for ``moduli = "run:..."``; raises ``InputError`` where it has none."""
    run = load_run(path)
    names = [f"E_{k}" for k in range(1, run.model.blueprint.simulation.order + 1)]
    listed = {item.name: item.draws for item in reported(run.model, run.draws)}
    if not set(names) <= set(listed):
        raise InputError(path / RUN_FILE, "moduli that depend on pressure", "a run with a constant law")
    draws = np.stack([listed[name] for name in names])
    return MaterialPosterior(
        mean=tuple(float(v) for v in draws.mean(axis=1)),
        covariance=tuple(tuple(float(v) for v in row) for row in np.atleast_2d(np.cov(draws))),
        strain_range=run.model.blueprint.tensile_range or NO_TEST,
        convention=run.model.blueprint.simulation.strain,
    )
