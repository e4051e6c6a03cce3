"""The same readings twice: a file under two names, rows of a force map that were pasted again."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from mpam_calib.specimen.recording import Floats, ForceMap

FEWEST = 5
"""Rows that are those above again, before they are taken for pasted."""
RESOLVED = 1e-3
"""A load cell that shows this share of its largest reading does not read a force twice by chance."""


def same_content(paths: Iterable[Path]) -> tuple[Path, Path] | None:
    """The first two of these files that hold the same bytes; None where there are none, or they are empty."""
    seen: dict[tuple[int, str], Path] = {}
    sizes: dict[int, list[Path]] = {}
    for path in paths:
        sizes.setdefault(path.stat().st_size, []).append(path)
    # Of large files only those of one size are read.
    for size, alike in sizes.items():
        for path in alike if size and len(alike) > 1 else []:
            try:
                with path.open("rb") as stream:
                    key = size, hashlib.file_digest(stream, "sha256").hexdigest()
            except OSError:
                continue  # its reader says so
            if key in seen:
                return seen[key], path
            seen[key] = path
    return None


def _in_steps(force: Floats, least: float) -> bool:
    """Whether forces are written in decimal steps of ``least`` or more."""
    places = force / 10.0 ** np.ceil(np.log10(least))
    return bool(np.all(np.abs(places - np.round(places)) < 1e-6))


def repeated_rows(force_map: ForceMap) -> list[str]:
    """A remark where rows of a force map are others again, to the last digit."""
    told = ~force_map.censored & (force_map.force_N != 0.0)
    force = force_map.force_N[told]
    if not len(force) or _in_steps(force, RESOLVED * float(np.abs(force).max())):
        return []
    rows = np.column_stack([force_map.pressure_Pa, force_map.contraction, force_map.branch])[told]
    again = len(force) - len(np.unique(np.column_stack([rows, force]), axis=0))
    if again < FEWEST:
        return []
    return [
        f"force_map: {again} of {len(told)} rows are other rows again, the force included; was something "
        "pasted twice? A repeat is a measurement of its own"
    ]
