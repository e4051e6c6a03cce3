"""Where results may go; tables and JSON so that the same numbers give the same bytes, whole or not at all."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import pandas as pd

from mpam_calib.atomic_files import write_atomically
from mpam_calib.errors import InputError
from mpam_calib.posterior.stored import POSTERIOR, RUN_FILE
from mpam_calib.specimen.recording import Specimen
from mpam_calib.specimen.toml_source import SPECIMEN_FILE

KEPT_FILE = "kept.json"
"""The mark of a finished diagnosis or selection, with the digest of each of its files."""
REPRODUCTION = "reproduction.csv"
"""The thesis recomputed."""
CHECKPOINT, UNFINISHED = "checkpoint", "unfinished"
"""Where a calibration, and a diagnosis or selection, keep what an interruption leaves."""
OWNERS = {
    SPECIMEN_FILE: "a specimen's folder",
    RUN_FILE: "a calibration's folder",
    KEPT_FILE: "a diagnosis's or selection's folder",
    REPRODUCTION: "a reproduction's folder",
}
GENERIC = (
    "summary.csv", "bands.csv", POSTERIOR, "report.html",
    "predictions.csv", "designs.csv", "designs.html",
    "models.csv", "prior_sensitivity.csv", "diagnosis.json",
)  # fmt: skip
"""All that a command writes into such a folder, or removes from it: others use these names as well ..."""
MARKS = (RUN_FILE, KEPT_FILE, CHECKPOINT, UNFINISHED, REPRODUCTION)
"""... and they are ours beside one of these, of which there is always one, finished or not."""


def demand_folder(path: Path, *replaces: str) -> None:
    """Raise ``InputError`` where results cannot be written to a folder, or would mix with what others left.

    ``replaces`` as in :func:`demand_own`.
    """
    demand_own(path, *replaces)
    demand_writable(path)


def demand_own(path: Path, *replaces: str) -> None:
    """Raise ``InputError`` where results would mix with what others left, written or not.

    ``replaces`` names those of ``OWNERS`` whose folders may be written again.
    """
    if path.exists() and not path.is_dir():
        raise InputError(path, "a file", "a folder to write into, or a new name")
    for name, owner in OWNERS.items():
        if name not in replaces and (path / name).exists():
            raise InputError(path, owner, "one of its own for these results")
    others = [name for name in GENERIC if (path / name).exists()]
    if others and not any((path / name).exists() for name in MARKS):
        raise InputError(path / others[0], "a file that no run wrote", "a new folder for these results")


def demand_writable(path: Path) -> None:
    """Raise ``InputError`` where a folder cannot be written, or made."""
    there = next(folder for folder in (path.absolute(), *path.absolute().parents) if folder.exists())
    if not there.is_dir():
        raise InputError(there, "a file", "a folder to make the run in")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(there, "a folder that may not be written", "one that may")


def demand_forces(specimen: Specimen, expected: str) -> None:
    """Raise ``InputError`` where there are no forces along a stroke, before anything else is told."""
    if specimen.loops is None and specimen.force_map is None:
        raise InputError(specimen.folder / SPECIMEN_FILE, "no loops and no force map", expected)


def write_csv(table: pd.DataFrame, path: Path) -> None:
    """A table with nine significant digits: more than any of them means, fewer than differ by chance."""
    write_atomically(
        path, lambda p: table.to_csv(p, index=False, float_format="%.9g", lineterminator="\n", na_rep="")
    )


def write_json(content: dict[str, Any], path: Path) -> None:
    """JSON with sorted keys."""
    text = json.dumps(content, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"
    write_atomically(path, lambda p: p.write_text(text, encoding="utf-8"))
