"""Data flow one way: no package knows of one above it."""

from __future__ import annotations

import ast
from pathlib import Path

import mpam_calib

LAYERS = (
    *("errors", "units", "arviz_import", "physics", "specimen", "model", "posterior", "criticism"),
    *("prediction", "design", "report", "thesis", "calibration", "run", "cli", "__init__", "__main__"),
)
ROOT = Path(mpam_calib.__file__).parent


def imported(file: Path) -> set[str]:
    """Layers that a file imports from, lazily or not."""
    found = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file}: a relative import"
            names = [node.module or ""]
            if node.module == "mpam_calib":
                names = [f"mpam_calib.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        found |= {name.split(".")[1] for name in names if name.startswith("mpam_calib.")}
    return found & set(LAYERS)


def test_every_part_has_a_layer() -> None:
    parts = {file.relative_to(ROOT).with_suffix("").parts[0] for file in ROOT.rglob("*.py")}
    assert parts == set(LAYERS)


def test_no_layer_knows_of_one_above_it() -> None:
    upward = []
    for file in ROOT.rglob("*.py"):
        own = file.relative_to(ROOT).with_suffix("").parts[0]
        upward += [
            f"{file.relative_to(ROOT)} -> {other}"
            for other in imported(file)
            if LAYERS.index(other) > LAYERS.index(own)
        ]
    assert upward == []
