"""One calibration's folder: posterior.nc, summary.csv, bands.csv, run.json, report.html."""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from mpam_calib.atomic_files import sweep
from mpam_calib.calibration import Calibration
from mpam_calib.model.effect import effect
from mpam_calib.posterior.chains.checkpoint import Checkpoint
from mpam_calib.posterior.stored import POSTERIOR, RUN_FILE, readable, write_draws
from mpam_calib.prediction.recorded import RECORDED, Recorded
from mpam_calib.run.asked import LEFT_OUT, kept_left_out
from mpam_calib.run.files import CHECKPOINT, write_csv, write_json
from mpam_calib.run.kept import written_over
from mpam_calib.run.provenance import provenance
from mpam_calib.specimen.recording import Specimen

REPORT = "report.html"
WRITTEN = (RUN_FILE, POSTERIOR, "summary.csv", "bands.csv", REPORT)
"""What a finished calibration leaves."""
DERIVED = ("predictions.csv", "designs.csv", "designs.html")
"""What later commands add, and what goes when the posterior they came from goes."""
PROVENANCE = "provenance"
"""Where ``run.json`` says of data that they are no measurements; older versions did not."""
PACKAGE = Path(__file__).parents[1]
PACKAGES = ("mpam-calib", "arviz", "emcee", "numpy", "scipy", "pandas")


def versions() -> dict[str, str]:
    """Versions of what a result depends on."""
    return {name: importlib.metadata.version(name) for name in PACKAGES}


def run_digest(specimen: Specimen, *, searched: Iterable[str] = (), **options: Any) -> str:
    """SHA-256 over data, model, options, versions and code: what decides whether a RUN can be kept.

    ``searched`` are effects that may come into the result besides the declared ones. Over what is said of
    where the data come from, too: it may stand in a comment, which no digest of a specimen holds.
    """
    effects = sorted({*specimen.simulation.effect_ids, *searched})
    content = [specimen.digest, provenance(specimen), options, versions(), effects, _code(effects)]
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()


def _code(effects: Iterable[str]) -> str:
    """SHA-256 over this package's files and the modules that any of the effects come from.

    A version stays the same while its code is worked on, and says nothing of a laboratory's own effects.
    """
    items = [effect(identifier) for identifier in effects]
    functions = [f for e in items for f in (e.parameters, e.apply, *e.forms.values(), *e.own.values())]
    modules = {getattr(f, "__module__", None) or "" for f in functions}
    outside = {getattr(sys.modules.get(name), "__file__", None) for name in modules}
    files = {Path(file) for file in outside if file}
    files |= {path for path in PACKAGE.rglob("*") if path.is_file() and path.suffix != ".pyc"}
    sums = sorted(hashlib.sha256(path.read_bytes()).hexdigest() for path in files)
    return hashlib.sha256("".join(sums).encode()).hexdigest()


@dataclass(frozen=True)
class RunFolder:
    """A RUN folder and the digest of what it should hold."""

    path: Path
    digest: str

    @property
    def checkpoint(self) -> Checkpoint:
        """Where an unfinished run keeps its blocks."""
        return Checkpoint(self.path / CHECKPOINT, self.digest)

    def state(self) -> dict[str, Any] | None:
        """``run.json`` where it belongs to this digest, else None."""
        try:
            content: dict[str, Any] = json.loads((self.path / RUN_FILE).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            return None
        return content if isinstance(content, dict) and content.get("digest") == self.digest else None

    def complete(self) -> bool:
        """Whether all that a finished calibration leaves is there, its own page too, and can be read."""
        there = all((self.path / name).is_file() for name in WRITTEN)
        return there and not written_over(self.path / REPORT) and readable(self.path / POSTERIOR)

    def clear(self) -> None:
        """Remove an older run's results, the mark of a finished run first, and what was left half-written."""
        self.path.mkdir(parents=True, exist_ok=True)
        for name in (*WRITTEN, *DERIVED):
            (self.path / name).unlink(missing_ok=True)
        sweep(self.path)

    def write(self, calibration: Calibration, bands: pd.DataFrame, left_out: pd.DataFrame) -> None:
        """Write everything but the report; ``run.json`` comes last, as the mark of a finished run.

        ``left_out`` as in the report's view.
        """
        write_csv(calibration.summary, self.path / "summary.csv")
        write_csv(bands, self.path / "bands.csv")
        write_draws(
            self.path / POSTERIOR,
            calibration.draws,
            calibration.reported,
            calibration.sampling.log_prob,
            self.digest,
        )
        content = describe(calibration, self.digest) | {LEFT_OUT: kept_left_out(left_out)}
        write_json(content, self.path / RUN_FILE)


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
        PROVENANCE: provenance(specimen),
        "blueprint": calibration.model.blueprint.model_dump(mode="json"),
        RECORDED: Recorded.of(specimen).as_json(),
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
