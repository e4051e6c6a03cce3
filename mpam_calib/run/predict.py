"""``predict``: bands of a finished RUN at any pressures."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.calibration import predict
from mpam_calib.errors import InputError
from mpam_calib.posterior.stored import load_run
from mpam_calib.prediction.recorded import Recorded
from mpam_calib.run.asked import remarks
from mpam_calib.run.files import demand_writable, write_csv
from mpam_calib.specimen.plausibility import HIGHEST_LEVEL_KPA
from mpam_calib.units import KPA

Array = NDArray[np.float64]

OPTION = "--pressure"
MOST = 2000
AT_ONCE = 8
"""Pressures predicted together: bounds the memory."""


def parse_pressures(text: str) -> Array:
    """Pressures (kPa) of ``A:B:STEP``, B included whether or not a step ends there, or of a single ``A``.

    >>> parse_pressures("100:200:50").tolist()
    [100.0, 150.0, 200.0]
    >>> parse_pressures("0:0.3:0.1").tolist()
    [0.0, 0.1, 0.2, 0.3]
    >>> parse_pressures("100:250:100").tolist()
    [100.0, 200.0, 250.0]
    """
    found, expected = f'"{" ".join(text.split())}"', "A or A:B:STEP in kPa with 0 <= A <= B and STEP > 0"
    try:
        parts = [float(part) for part in text.split(":")]
    except ValueError as error:
        raise InputError(OPTION, found, expected) from error
    if len(parts) == 1:
        parts = [parts[0], parts[0], 1.0]
    if len(parts) != 3 or not all(map(math.isfinite, parts)):
        raise InputError(OPTION, found, expected)
    first, last, step = parts
    if not 0.0 <= first <= last or step <= 0.0:
        raise InputError(OPTION, found, expected)
    if last > HIGHEST_LEVEL_KPA:
        raise InputError(OPTION, found, f"pressures in kPa, at most {HIGHEST_LEVEL_KPA:g}")
    # Rounding must neither lose the last pressure nor double it.
    steps = (last - first) / step
    if steps >= MOST:
        raise InputError(OPTION, f"more than {MOST} pressures in {found}", "a larger STEP")
    before = np.arange(math.ceil(steps - 1e-6)) if steps > 1e-6 else np.zeros(0)
    return np.append(np.round(first + step * before, 9), last)


@dataclass(frozen=True)
class Predicted:
    """The table's path, and what to know before its numbers are used."""

    path: Path
    remarks: list[str]


def predict_to_folder(run: Path, pressures_kPa: Array | None, seed: int | None = None) -> Predicted:
    """Write ``RUN/predictions.csv`` at pressures (the levels without)."""
    stored = load_run(run)
    demand_writable(run)
    model = stored.model
    seed = stored.seed if seed is None else seed
    if model.chain is None:
        if pressures_kPa is not None:
            raise InputError(OPTION, "pressures", "none: this run is of a material, not of a muscle")
        table = predict(model, stored.draws, seed)
        found = []
    else:
        levels = np.array(model.blueprint.levels) / KPA if pressures_kPa is None else pressures_kPa
        chunks = [levels[i : i + AT_ONCE] for i in range(0, len(levels), AT_ONCE)]
        # The material's bands, where there are any, are the same in every part.
        recorded = Recorded.kept(stored.state)
        parts = [predict(model, stored.draws, seed, chunk, recorded) for chunk in chunks]
        table = pd.concat(parts, ignore_index=True)
        tables = [rows for _, rows in table.groupby(["quantity", "branch"], sort=False)]
        table = pd.concat(tables, ignore_index=True).drop_duplicates(ignore_index=True)
        found = remarks(model, stored.state, levels, table)
    path = run / "predictions.csv"
    write_csv(table, path)
    return Predicted(path, found)
