"""Whitening of what is tied together in some way, against the covariances themselves."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg, sparse

from mpam_calib.criticism.data.whitening import Axes, Whitening


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
