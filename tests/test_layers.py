"""Data flow one way: no package knows of one above it."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import mpam_calib

LAYERS = (
    *(
        "errors",
        "units",
        "arviz_import",
        "atomic_files",
        "physics",
        "specimen",
        "model",
        "posterior",
        "criticism",
    ),
    *("prediction", "design", "report", "thesis", "calibration", "run", "cli", "__init__", "__main__"),
)
ROOT = Path(mpam_calib.__file__).parent
INSIDE = {
    "posterior": ("likelihood", "density", "chains", "evidence"),
    "criticism": ("data", "tasks", "fitting", "searching", "unexplained", "selection"),
}
"""The parts of a layer that has parts, from below; files beside them know all of these."""


def imported(file: Path) -> set[str]:
    """Layers that a file imports from, lazily or not."""
    return {name.split(".")[1] for name in imports(file)} & set(LAYERS)


def imports(file: Path) -> set[str]:
    """Modules of the package that a file imports from, by their full names."""
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
        found |= {name for name in names if name.startswith("mpam_calib.")}
    return found


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


@pytest.mark.parametrize("layer", INSIDE)
def test_no_part_of_a_layer_knows_of_one_above_it(layer: str) -> None:
    parts = INSIDE[layer]
    assert {folder.name for folder in (ROOT / layer).iterdir() if (folder / "__init__.py").exists()} == {
        *parts
    }
    upward = []
    for own in parts:
        for file in (ROOT / layer / own).rglob("*.py"):
            for name in imports(file):
                other = name.removeprefix(f"mpam_calib.{layer}.").split(".")[0]
                if name.startswith(f"mpam_calib.{layer}.") and other not in parts[: parts.index(own) + 1]:
                    upward.append(f"{file.relative_to(ROOT)} -> {name}")
    assert upward == []
