"""A muscle whose bladder has a tensile test of its own: the test is what its simulation is judged by."""

from __future__ import annotations

from functools import cache

import numpy as np
from rig import case as rig_case
from rig import recipes, sets
from rig.muscle import polynomial_stress

from mpam_calib.criticism.candidates import candidates
from mpam_calib.criticism.problem import Problem, build_problem
from mpam_calib.criticism.search import search
from mpam_calib.criticism.verdict import Verdict, judge
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.specimen import read


@cache
def problem_with(folder, factor: float) -> Problem:
    """A muscle that hides nothing; its bladder's test reads ``factor`` times the stress."""
    recipe = next(r for r in sets.recipes("develop") if r.group == "null" and r.moduli == "tensile")
    one = recipes.build_case(recipe)
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


def verdict_of(problem: Problem) -> Verdict:
    return judge(search(problem, candidates(problem).tested))


def test_a_test_that_agrees_leaves_nothing_to_explain(tmp_path_factory) -> None:
    assert verdict_of(problem_with(tmp_path_factory.mktemp("same"), 1.0)).word == "adequate"


def test_a_test_of_a_stiffer_rubber_is_contradicted(tmp_path_factory) -> None:
    assert verdict_of(problem_with(tmp_path_factory.mktemp("stiffer"), 1.5)).word != "adequate"
