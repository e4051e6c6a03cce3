"""Writing tables and JSON so that the same numbers give the same bytes, whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pandas as pd

from mpam_calib.posterior.checkpoint import write_atomically


def write_csv(table: pd.DataFrame, path: Path) -> None:
    """A table with nine significant digits: more than any of them means, fewer than differ by chance."""
    write_atomically(
        path, lambda p: table.to_csv(p, index=False, float_format="%.9g", lineterminator="\n", na_rep="")
    )


def write_json(content: dict[str, Any], path: Path) -> None:
    """JSON with sorted keys."""
    text = json.dumps(content, indent=1, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"
    write_atomically(path, lambda p: p.write_text(text, encoding="utf-8"))
