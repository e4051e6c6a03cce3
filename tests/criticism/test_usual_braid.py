"""Strands that rub, in a muscle whose specimen declares none."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest
from rig import case as rig_case
from rig.muscle import Braid, Geometry, Law, Muscle, Simulation
from rig.protocol import Protocol

from mpam_calib.criticism import diagnose as module
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.searching.candidates import Candidates, candidates
from mpam_calib.criticism.searching.usual_braid import usual_braid
from mpam_calib.run.diagnose import diagnose_to_folder
from mpam_calib.specimen import read

MODULI = (60e3, 20e3)
STRANDS = Braid(70.0, 0.36, 0.2, 96)
"""Of aramid, unlike those that are assumed."""
MUSCLE = Muscle(
    "bare",
    Geometry(120.0, 8.0, 1.2, 71.0),
    STRANDS,
    Simulation(
        friction="coulomb",
        friction_value=(0.04,),
        law=Law("constant", tuple((E,) for E in MODULI)),
        declared_E_Pa=MODULI,
    ),
)
SUSPECTS = {"strand_friction", "braid_stretch", "presliding", "force_drift", "dead_band", "wall_pressure"}


def suspects(problem: Problem) -> Candidates:
    every = candidates(problem)
    return replace(every, tested=tuple(e for e in every.tested if e in SUSPECTS))


def diagnosed(folder: Path, hidden: rig_case.Hidden, patch: pytest.MonkeyPatch) -> Path:
    """The run of a specimen without its [braid]."""
    levels = (60.0, 120.0, 180.0, 240.0, 300.0)
    protocol = Protocol(levels, speeds_mm_s=(4.0,), rows_max=1500, noise_N=0.6, correlated_N=0.3)
    rig_case.write_case(
        rig_case.Case("bare", 1, "separable", MUSCLE, protocol, (hidden,)),
        folder / "specimen",
        folder / "truth.json",
    )
    toml = folder / "specimen" / "specimen.toml"
    toml.write_text(re.sub(r"\[braid\].*?(?=\n\[)", "", toml.read_text(), flags=re.DOTALL))
    assert read(folder / "specimen").braid is None
    patch.setattr(module, "candidates", suspects)
    diagnose_to_folder(folder / "specimen", folder / "run")
    return folder / "run"


def test_strands_that_rub_are_told_by_how_their_friction_goes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = diagnosed(tmp_path, rig_case.Hidden("strand_friction", "hertz", 0.4), monkeypatch)
    content = json.loads((run / "diagnosis.json").read_text())
    assert content["verdict"] == "named"
    assert [c["id"] for c in content["causes"]] == ["strand_friction"]
    # Its size is that of the strands that were assumed, and everything says so.
    assumed = usual_braid(read(tmp_path / "specimen").geometry)
    told = content["causes"][0]["parameters"]["f_s"]
    softer = ((1.0 - 0.33**2) / 2.1 / (1.0 - STRANDS.nu_s**2) * STRANDS.E_br_GPa) ** (1.0 / 3.0)
    assert told["q05"] < 0.4 / softer < told["q95"]
    assert content["assumed_braid"] == assumed.model_dump()
    assert "has no [braid]" in (run / "report.html").read_text()
    assert {n["id"] for n in content["not_tested"]} >= {"braid_stretch"}
    assert "strand_friction" not in {n["id"] for n in content["not_tested"]}
    extended = read(run / "extended")
    assert extended.braid == assumed and extended.simulation.effect_ids == ("strand_friction",)
    assert "# assumed, not measured" in (run / "extended" / "specimen.toml").read_text()


def test_where_they_do_not_nothing_is_said_of_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = diagnosed(tmp_path, rig_case.Hidden("dead_band", "sharp", 9.0), monkeypatch)
    content = json.loads((run / "diagnosis.json").read_text())
    assert [c["id"] for c in content["causes"]] == ["dead_band"]
    assert content["assumed_braid"] is None and read(run / "extended").braid is None
    why = {n["id"]: n["why"] for n in content["not_tested"]}
    assert why["braid_stretch"] == why["strand_friction"] and "no [braid]" in why["braid_stretch"]
    assert not {"braid_stretch", "strand_friction"} & {limit["id"] for limit in content["limits"]}
