"""Writing synthetic recordings as a specimen folder that calls itself synthetic."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import tomlkit

from mpam_calib.atomic_files import write_atomically
from mpam_calib.errors import InputError
from mpam_calib.posterior.material import keep_material
from mpam_calib.prediction.simulate import Simulated
from mpam_calib.run.files import demand_folder, write_csv, write_json
from mpam_calib.specimen.recording import BRANCH_WORDS, ForceMap, Loops
from mpam_calib.specimen.toml_source import SPECIMEN_FILE
from mpam_calib.units import KPA, MM

WORDS = {code: word for word, code in BRANCH_WORDS.items()}
LOOPS, FORCE_MAP, TENSILE = "loops_synthetic.csv", "force_map_synthetic.csv", "tensile.csv"
TRUTH = "truth.json"


def demand_synthetic_folder(path: Path) -> None:
    """Raise ``InputError`` where a synthetic specimen cannot be written; only another one is replaced."""
    ours = all((path / name).exists() for name in (SPECIMEN_FILE, TRUTH))
    demand_folder(path, *([SPECIMEN_FILE] if ours else []))
    others = [name for name in (TENSILE, TRUTH) if (path / name).exists()]
    if others and not ours:
        raise InputError(path / others[0], "a file that no simulation wrote", "a new folder for these data")


def write_specimen(simulated: Simulated, source: Path, folder: Path) -> None:
    """Write specimen.toml (the source's, with new files), the synthetic CSV files and truth.json."""
    document = tomlkit.parse(source.read_text(encoding="utf-8-sig"))
    identity: Any = document["specimen"]  # a table in its own lines, or in braces
    name = str(identity["name"])
    identity["name"] = name if name.endswith("(synthetic)") else f"{name} (synthetic)"
    for table in ("files", "columns", "csv"):
        document.pop(table, None)
    files = tomlkit.table()
    specimen = simulated.specimen
    keep_material(document, specimen, folder)
    if specimen.loops is not None:
        files["loops"] = _write_loops(specimen.loops, specimen.levels_Pa, folder)
    if specimen.force_map is not None:
        files["force_map"] = FORCE_MAP
        write_csv(_map_table(specimen.force_map), folder / FORCE_MAP)
    if specimen.tensile is not None:
        files["tensile"] = TENSILE
        tensile = pd.DataFrame({"strain": specimen.tensile.strain, "stress_Pa": specimen.tensile.stress_Pa})
        write_csv(tensile, folder / TENSILE)
    document["files"] = files
    text = "# SYNTHETIC: made by a simulation, not by a rig.\n" + tomlkit.dumps(document)
    write_atomically(folder / SPECIMEN_FILE, lambda p: p.write_text(text, encoding="utf-8"))
    truth = {"hidden": simulated.hidden, "parameters": simulated.parameters}
    if simulated.not_shown:
        truth["not_shown"] = list(simulated.not_shown)
    write_json(truth, folder / TRUTH)


def _write_loops(loops: Loops, levels: np.ndarray, folder: Path) -> str | list[str]:
    """The names of the files: as many as were recorded, each on the clock on which its history begins."""
    table = pd.DataFrame(
        {
            "time_s": np.round(loops.time_s - loops.began_s, 6),
            "pressure_kPa": loops.pressure_Pa / KPA,
            "displacement_mm": loops.displacement_m / MM,
            "force_N": loops.force_N,
            "setpoint_kPa": np.round(levels[loops.level] / KPA, 3),
            "cycle": loops.cycle,
            "branch": pd.Series(loops.branch).map(WORDS).to_numpy(),
        }
    )
    parts = [part for _, part in table.groupby(loops.clock)]
    names = [f"loops_{i}_synthetic.csv" for i in range(1, len(parts) + 1)] if len(parts) > 1 else [LOOPS]
    for part, name in zip(parts, names, strict=True):
        write_csv(part, folder / name)
    return names if len(parts) > 1 else LOOPS


def _map_table(grid: ForceMap) -> pd.DataFrame:
    return pd.DataFrame(
        {
            "pressure_kPa": grid.pressure_Pa / KPA,
            "contraction": grid.contraction,
            "force_N": grid.force_N,
            "branch": pd.Series(grid.branch).map(WORDS).to_numpy(),
            "censored": grid.censored.astype(int),
        }
    )
