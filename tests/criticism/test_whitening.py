"""Whitening with ties between strokes, against the covariance itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg, sparse

from mpam_calib.criticism.whitening import Whitening


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
    assert sparse.issparse(found.apart) == (blocks == 30)
    np.testing.assert_allclose(found @ (found @ covariance).T, np.eye(n), atol=1e-8)
    column = rng.standard_normal(n)
    assert (found @ column) @ (found @ column) == pytest.approx(column @ linalg.solve(covariance, column))


def test_strokes_that_are_not_apart_are_refused() -> None:
    tied = np.ones((4, 1))
    with pytest.raises(np.linalg.LinAlgError):
        Whitening.build(np.eye(4) + tied @ tied.T, 2.0 * tied)
