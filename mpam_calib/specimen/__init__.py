"""What was measured and declared: reading a specimen folder into SI arrays."""

from __future__ import annotations

from pathlib import Path

from mpam_calib.specimen.arguments import demand_path
from mpam_calib.specimen.recording import Specimen

__all__ = ["Specimen", "read"]


def read(path: str | Path, *, data_required: bool = True) -> Specimen:
    """Read a specimen: ``path`` is its folder or its ``specimen.toml``.

    Raises ``InputError`` (file, row, column, what was found, what was expected) for anything that
    cannot be used. ``data_required=False`` also accepts a declaration without data files, as
    long as it holds the moduli (``E_Pa``) that a simulation needs.
    """
    demand_path(path)
    from mpam_calib.specimen.reading import read_specimen  # pandas takes half a second to import

    return read_specimen(Path(path), data_required=data_required)
