"""Whitening of what is tied together in some way, against the covariances themselves."""

from __future__ import annotations

import numpy as np
import pytest
from model import build
from scipy import linalg, sparse

from criticism.cases import problem_of
from mpam_calib.criticism.data.problem import HALF_WAVES, PRESSURE_LENGTH, SIZES, STROKE_SHARE, Problem
from mpam_calib.criticism.data.whitening import Axes, Whitening
from mpam_calib.specimen.recording import BlockedForce


@pytest.mark.parametrize("ties", [0, 2])
@pytest.mark.parametrize("blocks", [3, 30])
def test_it_whitens_the_covariance(ties: int, blocks: int) -> None:
    rng = np.random.default_rng(4)
    n = 10 * blocks
    apart = linalg.block_diag(*(np.eye(10) + g @ g.T for g in rng.standard_normal((blocks, 10, 3))))
    tied = 20.0 * rng.standard_normal((n, ties))
    covariance = apart + tied @ tied.T
    found = Whitening.build(covariance, tied)
    assert len(found) == n
    scaled = found.scaled(3.0)
    assert sparse.issparse(found.apart) == sparse.issparse(scaled.apart) == (blocks == 30)
    np.testing.assert_allclose(found @ (found @ covariance).T, np.eye(n), atol=1e-8)
    np.testing.assert_allclose(scaled @ (scaled @ (9.0 * covariance)).T, np.eye(n), atol=1e-8)
    column = rng.standard_normal(n)
    assert (found @ column) @ (found @ column) == pytest.approx(column @ linalg.solve(covariance, column))


def test_strokes_that_are_not_apart_are_refused() -> None:
    tied = np.ones((4, 1))
    with pytest.raises(np.linalg.LinAlgError):
        Whitening.build(np.eye(4) + tied @ tied.T, 2.0 * tied)


@pytest.mark.parametrize("groups", [1, 3])
def test_axes_part_two_covariances(groups: int) -> None:
    """Groups of rows that neither ties together, however they are mixed, have axes of their own."""
    rng = np.random.default_rng(5)
    n = 24
    label = rng.permutation(np.arange(n) % groups)
    together = label[:, None] == label
    noise, kernel = (np.where(together, g @ g.T, 0.0) for g in rng.standard_normal((2, n, n)))
    found = Axes.build(noise, kernel)
    assert len(found) == n
    assert sorted(len(rows) for rows, _ in found.blocks) == [n // groups] * groups
    for axes, covariance in ((found, noise), (found.scaled(3.0), 9.0 * noise)):
        np.testing.assert_allclose(axes @ (axes @ covariance).T, np.eye(n), atol=1e-8)
        np.testing.assert_allclose(axes @ (axes @ kernel).T, np.diag(axes.powers), atol=1e-7)
        assert axes.log_det == pytest.approx(np.linalg.slogdet(covariance)[1])
    column = rng.standard_normal(n)
    np.testing.assert_allclose(found @ column, (found @ column[:, None])[:, 0])


def test_rows_tied_by_one_of_the_two_alone_stay_together() -> None:
    tied = np.array([[2.0, 1.0], [1.0, 2.0]])
    assert len(Axes.build(np.eye(2), tied).blocks) == len(Axes.build(tied, np.eye(2)).blocks) == 1
    assert len(Axes.build(np.eye(2), np.eye(2)).blocks) == 2


@pytest.fixture(scope="module")
def problem() -> Problem:
    """Two cycles at three levels, and a blocked force at each."""
    recorded = build.loops(rows=20, cycles=2)
    blocked = BlockedForce(np.array([1e5, 1.5e5, 2e5]), np.full(3, 20.0), np.zeros(3, dtype=bool))
    made = build.specimen({"law": "constant", "order": 1}, recorded, blocked_force=blocked)
    noise = np.random.default_rng(0).standard_normal(len(recorded.time_s))
    return problem_of(build.with_force(made, 10.0 + noise))


@pytest.mark.parametrize("free", [False, True])
def test_the_remainder_is_alike_where_level_branch_and_place_are_and_each_stroke_s_own(
    problem: Problem, free: bool
) -> None:
    """Written out row by row: half-waves of mean square one along the stroke; a static row has no stroke."""
    kernel = (problem.with_free_strokes() if free else problem).kernel
    share = 1.0 if free else STROKE_SHARE
    at, longest, top = problem.middle(), problem.setting.stroke, 2e5
    size = np.array([1.0 / (1.0 + j) for j in range(HALF_WAVES)])
    size = size / np.sqrt(size[0] ** 2 + 0.5 * np.sum(size[1:] ** 2))
    wave = size * np.cos(np.pi * np.outer(at.displacement / longest, np.arange(HALF_WAVES)))
    some = [0, 5, 20, 40, 60, 70, 100, 150, 190, -3, -2, -1]
    assert len({(problem.stroke[i], problem.level[i], at.sign[i]) for i in some}) > 9
    for i in some:
        for j in some:
            alike = np.exp(-abs(at.pressure[i] - at.pressure[j]) / top / PRESSURE_LENGTH)
            alike *= at.sign[i] == at.sign[j]
            own = problem.stroke[i] == problem.stroke[j] != -1
            expected = (wave[i] @ wave[j]) * (alike + share**2 * own)
            assert kernel[i, j] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("scale", [1.0, 1.7])
@pytest.mark.parametrize("size", range(len(SIZES)))
def test_rows_are_whitened_by_noise_and_remainder_of_every_size(
    problem: Problem, size: int, scale: float
) -> None:
    scaled = problem.with_noise_scale(scale)
    dense = scale**2 * problem.noise + (SIZES[size] * problem.setting.force_scale) ** 2 * problem.kernel
    white = scaled.white(np.eye(len(problem)), size)
    assert white.T @ white @ dense == pytest.approx(np.eye(len(problem)), abs=1e-6)
    assert scaled.log_dets[size] == pytest.approx(np.linalg.slogdet(dense)[1], rel=1e-9)
