"""A muscle whose bladder has a tensile test of its own: the test is what its simulation is judged by."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rig import case as rig_case
from rig import recipes
from rig.muscle import polynomial_stress

from criticism.cases import null_recipe
from criticism.found import search
from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.criticism.verdict import judge
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.specimen import read


def problem_with(folder: Path, factor: float) -> Problem:
    """A muscle that hides nothing; its bladder's test reads ``factor`` times the stress."""
    one = recipes.build_case(null_recipe())
    place = folder / f"{factor}"
    rig_case.write_case(one, place, folder / "truth.json")
    simulation = one.muscle.simulation
    moduli = simulation.law.moduli(np.zeros(1), np.zeros(1))[..., 0].ravel()
    strain = np.linspace(0.02, 1.5, 60)
    stress = factor * 1e6 * polynomial_stress(moduli, strain)  # from N/mm²
    noise = 0.003 * stress.max() * np.random.default_rng(8).standard_normal(len(strain))
    rows = "".join(f"{e:.4f},{s:.1f}\n" for e, s in zip(strain, stress + noise, strict=True))
    (place / "tensile.csv").write_text("strain,stress_Pa\n" + rows)
    text = (place / "specimen.toml").read_text()
    lines = [line for line in text.splitlines() if not line.startswith(("E_Pa", "E_rel_sd"))]
    lines.insert(lines.index("[files]") + 1, 'tensile = "tensile.csv"')
    (place / "specimen.toml").write_text(
        "\n".join([*lines, f"order = {len(moduli)}", 'law = "constant"', ""])
    )
    specimen = read(place)
    return build_problem(specimen, draw_blueprint(specimen, Options(nuisances=False, remainder=False)))


def evidence(problem: Problem) -> float:
    """Of the declared simulation, at its best size of the remainder."""
    return max(fit(problem, frozenset(), size).log_evidence for size in range(len(SIZES)))


def test_a_test_that_agrees_leaves_nothing_to_explain(tmp_path: Path) -> None:
    problem = problem_with(tmp_path, 1.0)
    assert judge(search(problem, candidates(problem).tested)).word == "adequate"


def test_a_test_of_a_stiffer_rubber_is_contradicted(tmp_path: Path) -> None:
    agreeing, stiffer = (evidence(problem_with(tmp_path, factor)) for factor in (1.0, 1.5))
    assert stiffer < agreeing - 100.0
