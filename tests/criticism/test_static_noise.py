"""The noise of force maps, told by themselves: neither a curve nor a cause passes for it."""

from __future__ import annotations

import random
import time

import numpy as np
import pytest
from model import build
from rig.muscle import static_force
from rig.specimens import FAMILIES, loops_muscle

from criticism.found import search
from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.data.static_noise import static_noise
from mpam_calib.criticism.diagnose import diagnose
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.criticism.verdict import Verdict, judge
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.posterior.likelihood.points import gather_points
from mpam_calib.specimen.declaration import Geometry, Sensors
from mpam_calib.specimen.recording import ForceMap, Specimen

SHARES = np.array([0.25, 0.5, 0.75, 1.0])


def map_of(seed: int, noise: float, *, dead: float = 0.0, reach: float = 0.15, points: int = 14) -> Specimen:
    """A force map with both branches and white noise (a share of the top force), nothing of it declared.

    ``dead`` is the share of the highest pressure that does no work, which is not declared either.
    """
    rng = random.Random(f"map-{seed}")
    muscle, top = loops_muscle(FAMILIES[rng.choice(sorted(FAMILIES))], rng, law="constant", order=2)
    blocked = float(static_force(muscle, top, 0.0)[0])
    gamma = np.linspace(0.0, reach, points)
    side, P, x = (a.ravel() for a in np.meshgrid([-1, 1], top * SHARES, gamma, indexing="ij"))
    force = static_force(muscle, P - dead * top, x)
    force = force + 0.06 * np.abs(force) * side
    force = force + noise * blocked * np.random.default_rng(seed).standard_normal(len(force))
    g, levels = muscle.geometry, 1e3 * top * SHARES
    found = ForceMap(
        pressure_Pa=1e3 * P, contraction=x, force_N=force, level=np.searchsorted(levels, 1e3 * P - 1.0),
        branch=side, censored=np.zeros(len(force), dtype=bool),
    )  # fmt: skip
    geometry = Geometry(L0_mm=g.L0_mm, R0_mm=g.R0_mm, t0_mm=g.t0_mm, alpha0_deg=float(g.alpha0_deg))
    moduli = [float(c[0]) for c in muscle.simulation.law.constants]
    simulation = {
        "moduli": "tensile", "E_Pa": moduli, "E_rel_sd": 0.1, "order": 2, "law": "constant",
        "friction": "coulomb",
    }  # fmt: skip
    return build.specimen(
        simulation, levels_kPa=tuple(top * SHARES), geometry=geometry, sensors=Sensors(), force_map=found
    )


def problem_of(specimen: Specimen) -> Problem:
    return build_problem(specimen, draw_blueprint(specimen, Options(nuisances=False, remainder=False)))


def verdict_on(specimen: Specimen) -> Verdict:
    problem = problem_of(specimen)
    return judge(search(problem, candidates(problem).tested))


@pytest.mark.parametrize("noise", [0.0005, 0.005, 0.03])
@pytest.mark.parametrize("dead", [0.0, 0.05])
def test_noise_is_the_one_that_is_there(noise: float, dead: float) -> None:
    """Where the muscle pulls; friction that turns over where it begins to push is no smooth curve."""
    ratio = []
    for seed in range(10):
        specimen = map_of(seed, noise, dead=dead, reach=0.1)
        assert specimen.force_map is not None
        top = specimen.force_map.force_N[specimen.force_map.contraction == 0.0].max() / 1.06
        ratio.append(problem_of(specimen).noise_level.total / (noise * top))
    assert 0.9 < np.median(ratio) < 1.2
    assert min(ratio) > 0.7
    assert max(ratio) < 1.5


def test_a_few_readings_tell_nothing() -> None:
    specimen = map_of(0, 0.005, points=3)
    points = gather_points(specimen)
    assert points is not None
    assert static_noise(points, points.level(specimen.levels_Pa), 100.0) is None


def test_a_large_map_is_looked_at_in_part() -> None:
    """Thirty-two thousand readings, in seconds."""
    specimen = map_of(1, 0.005, reach=0.1, points=4000)
    assert specimen.force_map is not None
    points = gather_points(specimen)
    assert points is not None
    start = time.monotonic()
    found = static_noise(points, points.level(specimen.levels_Pa), 100.0)
    assert time.monotonic() - start < 20.0
    blocked = specimen.force_map.force_N[specimen.force_map.contraction == 0.0].max() / 1.06
    assert found == pytest.approx(0.005 * blocked, rel=0.2)


@pytest.mark.parametrize(("seed", "noise"), [(0, 0.002), pytest.param(1, 0.01, marks=pytest.mark.long)])
def test_nothing_hidden_is_adequate(seed: int, noise: float) -> None:
    assert verdict_on(map_of(seed, noise)).word == "adequate"


def test_a_cause_is_named_beside_a_noise_that_nobody_declared() -> None:
    found = verdict_on(map_of(0, 0.005, dead=0.05))
    assert (found.word, found.standing) == ("named", {"dead_band"})


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.long)])
def test_of_a_few_readings_the_noise_is_what_the_models_leave(seed: int) -> None:
    """So few that no neighbours tell it, and several times as noisy as the first guess: no fault is seen."""
    few = map_of(seed, 0.02, points=2)
    found = diagnose(few)
    assert found.problem.noise_guessed
    assert found.verdict.word == "adequate"
    first = build_problem(few, found.problem.blueprint).noise_level.total
    assert found.budget.noise > 1.5 * first
