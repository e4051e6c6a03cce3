"""A RUN read back: its two files belong together, and its effects must be there."""

from __future__ import annotations

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from mpam_calib.errors import InputError
from mpam_calib.posterior.stored import load_run

from .command import Here, stamps


def edited(run: Path, **simulation: object) -> None:
    """Write over keys of a run's simulation in its run.json."""
    state = json.loads((run / "run.json").read_text())
    state["blueprint"]["simulation"] |= simulation
    (run / "run.json").write_text(json.dumps(state))


@pytest.fixture
def copy(material_run: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(material_run, tmp_path / "copy"))


@pytest.mark.parametrize("effect", ["spring_back", "dead_band:sharp", "spring_back:bent"])
@pytest.mark.parametrize("command", ["predict", "optimize"])
def test_an_effect_that_is_not_installed(command: str, effect: str, copy: Path, here: Here) -> None:
    edited(copy, effects=[effect])
    before = stamps(copy)
    result = here(command, copy)
    assert result.code == 2
    assert result.complaint.startswith(f'error: {copy / "run.json"}: found the effect "{effect}"')
    assert "not installed" in result.complaint
    assert stamps(copy) == before


def test_a_material_with_such_an_effect(copy: Path, muscle: Path, tmp_path: Path, here: Here) -> None:
    edited(copy, effects=["spring_back"])
    specimen = Path(shutil.copytree(muscle, tmp_path / "small"))
    declaration = specimen / "specimen.toml"
    text = declaration.read_text().replace('moduli = "loops"', 'moduli = "run:../copy"')
    declaration.write_text(text.replace('law = "linear"', 'law = "constant"'))
    result = here("calibrate", specimen, "-o", tmp_path / "fresh")
    assert result.code == 2
    assert 'found the effect "spring_back"' in result.complaint
    assert not (tmp_path / "fresh").exists()


def test_draws_of_another_run_are_refused(copy: Path, material: Path, tmp_path: Path, here: Here) -> None:
    """Of the same data and model with another seed: nothing else tells."""
    other = tmp_path / "other"
    assert here("calibrate", material, "-o", other, "--seed", 7, "--ess", 100).code == 0
    shutil.copyfile(other / "posterior.nc", copy / "posterior.nc")
    result = here("predict", copy)
    assert result.code == 2
    assert result.complaint.startswith(f"error: {copy / 'posterior.nc'}: found the draws of another run")
    assert not (copy / "predictions.csv").exists()


def test_another_order_than_the_draws_have_is_refused(copy: Path, here: Here) -> None:
    edited(copy, order=3)
    result = here("predict", copy)
    assert result.code == 2
    assert result.complaint.startswith(f"error: {copy / 'run.json'}: found a model ")


def test_draws_of_an_older_version_name_the_data_alone(
    copy: Path, material_run: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    state = json.loads((copy / "run.json").read_text())
    state["digest"], state["specimen_digest"] = "of other code", state["digest"]
    (copy / "run.json").write_text(json.dumps(state))
    assert len(load_run(copy).draws) == len(load_run(material_run).draws)
    state["specimen_digest"] = "of other data"
    (copy / "run.json").write_text(json.dumps(state))
    with pytest.raises(InputError, match="the draws of another run"):
        load_run(copy)


def locked(monkeypatch: pytest.MonkeyPatch, folder: Path) -> None:
    """Let a folder say that it may not be written, whoever asks (root may always)."""
    ask = os.access

    def access(path: str | Path, mode: int) -> bool:
        return False if Path(path) == folder and mode & os.W_OK else ask(path, mode)

    monkeypatch.setattr(os, "access", access)


@pytest.mark.parametrize("command", ["predict", "optimize"])
def test_a_folder_that_may_not_be_written_is_told_first(
    command: str, copy: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    locked(monkeypatch, copy)
    before = stamps(copy)
    result = here(command, copy)
    assert result.code == 2
    assert result.complaint == f"error: {copy}: found a folder that may not be written, expected one that may"
    assert stamps(copy) == before


def test_a_finished_run_that_may_not_be_written_is_kept(
    copy: Path, material: Path, here: Here, monkeypatch: pytest.MonkeyPatch
) -> None:
    locked(monkeypatch, copy)
    before = stamps(copy)
    result = here("calibrate", material, "-o", copy)
    assert (result.code, result.err) == (0, "")
    assert "kept" in result.out
    assert stamps(copy) == before
    refused = here("calibrate", material, "-o", copy, "--seed", 1)
    assert refused.code == 2
    assert "found a folder that may not be written" in refused.complaint


def test_a_seed_changes_what_readings_add_and_nothing_else(copy: Path, here: Here) -> None:
    """Without one it is the run's own, which is 0."""
    tables = []
    for seed in ((), ("--seed", 0), ("--seed", 1)):
        assert here("predict", copy, *seed).code == 0
        tables.append(pd.read_csv(copy / "predictions.csv"))
    own, same, other = tables
    assert own.equals(same)
    observed = own["quantity"].str.endswith("_observed")
    assert observed.any() and own[~observed].equals(other[~observed])
    assert not np.isclose(own.loc[observed, "q95"], other.loc[observed, "q95"], rtol=1e-6).all()
