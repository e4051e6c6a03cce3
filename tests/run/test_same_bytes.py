"""The same seed gives the same bytes; another seed the same answer; neither times nor paths are kept."""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from .command import FAST, Here, contents

TABLES = ("summary.csv", "bands.csv", "run.json", "predictions.csv")


def test_one_seed_gives_the_same_bytes_anywhere(
    muscle: Path, run_copy: Path, tmp_path: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    import arviz as az

    # Another folder, another process, another name and other settings of the machine.
    specimen = Path(shutil.copytree(muscle, tmp_path / "elsewhere" / "renamed"))
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    again = tmp_path / "again"
    monkeypatch.chdir(tmp_path)
    assert here("calibrate", specimen / "specimen.toml", "-o", "again", *FAST).code == 0
    for run in (run_copy, again):
        assert here("predict", run, "--pressure", "100:220:40").code == 0
    one, other = contents(run_copy), contents(again)
    for name in TABLES:
        assert one[name] == other[name], name
    first, second = (az.from_netcdf(str(run / "posterior.nc")) for run in (run_copy, again))
    assert first.groups() == second.groups()
    for group in first.groups():
        assert first[group].identical(second[group]), group


@pytest.mark.long
def test_another_seed_agrees_within_its_monte_carlo_error(
    muscle: Path, muscle_run: Path, tmp_path: Path, here: Here
) -> None:
    assert here("calibrate", muscle, "-o", tmp_path / "run", *FAST, "--seed", 1).code == 0
    one = pd.read_csv(muscle_run / "summary.csv", index_col="parameter")
    other = pd.read_csv(tmp_path / "run" / "summary.csv", index_col="parameter")
    assert list(one.index) == list(other.index)
    error = np.sqrt(one["sd"] ** 2 / one["ess_bulk"] + other["sd"] ** 2 / other["ess_bulk"])
    apart = (one["mean"] - other["mean"]).abs() / error
    assert (apart > 0.0).all()
    assert (apart < 4.5).all(), apart


def test_no_times_and_no_paths_are_kept(muscle: Path, muscle_run: Path) -> None:
    text = (muscle_run / "run.json").read_text()
    assert not re.search(r"\d{4}-\d\d-\d\d|\d\d:\d\d", text)
    for word in (str(muscle.parent), str(muscle_run.parent), str(Path.home()), "/tmp"):
        assert word not in text
    keys = json.dumps(_keys(json.loads(text)))
    assert not re.search(r"time\b|seconds|date|path|folder", re.sub("(stroke|reading|level)_time", "", keys))


def _keys(item: object) -> list[str]:
    if isinstance(item, dict):
        return [key for k, v in item.items() for key in (str(k), *_keys(v))]
    if isinstance(item, list):
        return [key for v in item for key in _keys(v)]
    return []
