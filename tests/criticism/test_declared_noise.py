"""What ``[noise]`` declares, in the problem that hypotheses are compared on."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from prediction.coverage import as_specimen, rig_case
from rig.chain import force_of

from mpam_calib.criticism.data.build import build_problem
from mpam_calib.criticism.data.noise_level import noise_level
from mpam_calib.criticism.data.noise_windows import inside_strokes
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.model.noise import CORRELATED, TIME, WHITE
from mpam_calib.specimen import read
from mpam_calib.specimen.declaration import Noise
from mpam_calib.specimen.recording import ForceMap, Specimen

DATASETS = Path(__file__).parents[2] / "datasets"
GROWTH = 3.0
MADE = (0.20, 0.15, 0.1)
"""White and correlated sd (N) and correlation time (s) in ``datasets/rebuild.py``."""


def recorded(growth: float, declared: bool) -> Specimen:
    """A rig muscle whose white noise grows with its force, 1.5 sds of the sensor at no force."""
    muscle, rows, true, _, protocol = rig_case(1)
    scale = build_problem_of(as_specimen(muscle, rows, true, protocol)).force_scale
    noise = protocol.noise_N * np.random.default_rng(3).standard_normal(rows.count)
    reading = force_of(muscle, rows) + noise * np.sqrt(1.0 + (growth * true / scale) ** 2)
    return replace(as_specimen(muscle, rows, reading, protocol), noise=Noise(growth=declared))


def build_problem_of(specimen: Specimen) -> Problem:
    return build_problem(specimen, draw_blueprint(specimen, Options(nuisances=False, remainder=False)))


def spreads(problem: Problem) -> np.ndarray:
    """Standardised residuals' sds of the rows with small and with large forces, for the true model."""
    found = fit(problem, frozenset(), 0)
    z = (problem.force - found.force) / np.sqrt(np.diagonal(problem.noise))
    order = np.argsort(np.abs(problem.force))
    return np.array([part.std() for part in np.array_split(z[order], 3)])[[0, 2]]


def test_growing_noise_is_found_and_used() -> None:
    problem = build_problem_of(recorded(GROWTH, declared=True))
    assert problem.noise_level.growth == pytest.approx(GROWTH, rel=0.4)
    low, high = spreads(problem)
    assert 0.75 < low < 1.3
    assert 0.75 < high < 1.3


def test_undeclared_growth_is_not_modelled() -> None:
    """One size for all: too large where the force is small, too small where it is large."""
    problem = build_problem_of(recorded(GROWTH, declared=False))
    assert problem.noise_level.growth == 0.0
    low, high = spreads(problem)
    assert high > 1.3 * low


def test_declared_growth_that_is_not_there_changes_little() -> None:
    with_it = build_problem_of(recorded(0.0, declared=True))
    without = build_problem_of(recorded(0.0, declared=False))
    ratio = np.sqrt(np.diagonal(with_it.noise) / np.diagonal(without.noise))
    assert 0.9 < np.median(ratio) < 1.1
    assert ratio.max() < 1.3


def test_growth_of_static_readings() -> None:
    """A force map beside loops: its readings' sd follows their own force."""
    specimen = recorded(GROWTH, declared=True)
    assert specimen.loops is not None and specimen.geometry is not None
    rows = np.arange(0, len(specimen.loops.force_N), 9)
    force_map = ForceMap(
        pressure_Pa=specimen.loops.pressure_Pa[rows],
        contraction=specimen.loops.displacement_m[rows] / specimen.geometry.L0,
        force_N=specimen.loops.force_N[rows],
        level=specimen.loops.level[rows],
        branch=specimen.loops.branch[rows],
        censored=np.zeros(len(rows), dtype=bool),
    )
    with_map = build_problem_of(replace(specimen, force_map=force_map))
    level = with_map.noise_level
    static = with_map.stroke < 0
    wanted = level.total * np.sqrt(1.0 + (level.growth * with_map.force[static] / with_map.force_scale) ** 2)
    np.testing.assert_allclose(np.sqrt(np.diagonal(with_map.noise)[static]), wanted, rtol=1e-9)


@pytest.mark.parametrize("name", ["mpam1_reconstructed", "mpam2_reconstructed"])
def test_the_search_reaches_the_noise(name: str) -> None:
    """What is found is at least as probable as the noise with which the data set was made."""
    specimen = read(DATASETS / name)
    assert specimen.loops is not None
    model = build_problem_of(specimen).model
    found, windows = noise_level(specimen.loops, model), inside_strokes(specimen.loops)
    assert found is not None
    assert windows is not None
    scatter = windows.usual(grows=False).scatter(float(np.median(windows.dt)))
    priors = {p.name: p.prior for p in model.parameters}

    def log_posterior(*sizes: float) -> float:
        values = [np.array([v]) for v in sizes]
        u = [priors[n].to_normal(v)[0] for n, v in zip((WHITE, CORRELATED, TIME), values, strict=True)]
        return float(scatter.log_likelihood(1, *values)[0]) - 0.5 * float(np.square(u).sum())

    assert log_posterior(found.white, found.correlated, found.time) >= log_posterior(*MADE)
    assert found.total == pytest.approx(np.hypot(*MADE[:2]), rel=0.1)
