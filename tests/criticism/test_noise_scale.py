"""How large the noise is, from what the best set leaves."""

from __future__ import annotations

import numpy as np
import pytest
from model import build

from criticism.cases import problem_of, specimen_of
from criticism.test_evidence import loops_of_a_rig
from mpam_calib.criticism.data.problem import SIZES, Problem
from mpam_calib.criticism.fitting.fit import Fit, fit
from mpam_calib.criticism.fitting.noise_scale import _by_scale, noise_scale, settle_noise
from mpam_calib.criticism.selection.space import model_space
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import ForceMap, Specimen


def fits(problem: Problem) -> list[Fit]:
    return [fit(problem, frozenset(), size) for size in range(len(SIZES))]


@pytest.fixture(scope="module")
def drawn() -> Problem:
    """Forces that are the declared simulation's, with just the noise that is supposed."""
    problem = problem_of(specimen_of(loops_of_a_rig()))
    noise = np.linalg.cholesky(problem.noise) @ np.random.default_rng(0).standard_normal(len(problem))
    return problem.with_force(fit(problem, frozenset(), 0).force + noise)


@pytest.mark.parametrize("wrong", [0.6, 1.0, 1.5])
def test_noise_that_is_taken_for_too_large_or_too_small_is_put_right(drawn: Problem, wrong: float) -> None:
    supposed = drawn.with_noise_scale(wrong)
    assert supposed.noise_level == drawn.noise_level
    assert wrong * noise_scale(supposed, fits(supposed)) == pytest.approx(1.0, abs=0.07)


def test_settled_parameters_widen_with_the_noise(drawn: Problem) -> None:
    """The evidence at another scale, the mode held, is that of a fit there (about linear)."""
    one = fit(drawn, frozenset(), 0)
    scales = np.array([-0.2, 0.2])
    found = _by_scale(drawn, [one], scales) - one.log_share
    again = [fit(drawn.with_noise_scale(float(np.exp(s))), frozenset(), 0) for s in scales]
    assert found == pytest.approx([f.log_evidence - one.log_evidence for f in again], abs=0.05)


def test_smooth_misfit_is_not_taken_for_noise(drawn: Problem) -> None:
    """The remainder holds it: a bump of five times a row's noise, the same in every stroke."""
    x = drawn.middle().displacement
    bump = np.exp(-0.5 * ((x / x.max() - 0.5) / 0.1) ** 2)
    missed = drawn.with_force(drawn.force + 5.0 * np.sqrt(np.median(np.diagonal(drawn.noise))) * bump)
    assert noise_scale(missed, fits(missed)) == pytest.approx(1.0, abs=0.15)


def small_map(share: float, seed: int, sensors: Sensors) -> tuple[Specimen, float]:
    """Four contractions at five levels of a muscle with one constant modulus; and the noise that is in it, N.

    ``share`` of the force scale; neither readings nor declaration tell it.
    """
    levels = np.array([100.0, 150.0, 200.0, 250.0, 300.0])
    P, x = (a.ravel() for a in np.meshgrid(1e3 * levels, np.linspace(0.0, 0.2, 4), indexing="ij"))
    none, level = np.zeros(len(P), dtype=np.int64), np.searchsorted(1e3 * levels, P)

    def with_force(force: np.ndarray) -> Specimen:
        made = ForceMap(P, x, force, level, none, none.astype(bool))
        simulation = {"law": "constant", "order": 1, "friction": "none"}
        return build.specimen(simulation, levels_kPa=tuple(levels), sensors=sensors, force_map=made)

    problem = problem_of(with_force(np.ones(len(P))))
    assert problem.model.chain is not None
    force = problem.model.chain.force({"": np.zeros((1, 1))}, np.full((1, 1), -0.3), problem.middle())[0]
    noise = share * problem.force_scale
    return with_force(force + noise * np.random.default_rng(seed).standard_normal(len(P))), noise


@pytest.mark.parametrize("share", [0.001, 0.04])
def test_a_guess_is_settled_by_all_models_together(share: float) -> None:
    """Twenty readings: moduli free at each level fit them whatever the noise is, and say nothing of it."""
    ratio = []
    for seed in range(5):
        specimen, noise = small_map(share, seed, Sensors())
        problem = problem_of(specimen)
        assert problem.noise_guessed
        space = [s for s in model_space(specimen) if s.order <= 3]
        ratio.append(np.sqrt(settle_noise(problem, space).noise[0, 0]) / noise)
    assert 0.7 < np.median(ratio) < 1.4
    assert min(ratio) > 0.4
    assert max(ratio) < 2.5


def test_a_declared_noise_is_no_guess() -> None:
    specimen, _ = small_map(0.01, 0, Sensors(force_sd_N=0.5))
    assert not problem_of(specimen).noise_guessed
