"""One matrix at fault among many: it has no density, and the others keep theirs."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.posterior.density.piece import segment_piece
from mpam_calib.posterior.likelihood.algebra import cholesky, inverse, solve
from mpam_calib.posterior.likelihood.scatter import FastScatter
from mpam_calib.posterior.likelihood.sites import chunk_log_likelihood

M = 3
FAULTY = np.full((M, M), 1e20)
"""A size that all rows share and that swamps their noise: the noise is lost to rounding."""


def matrices(seed: int, count: int) -> np.ndarray:
    """Positive definite ones (count, M, M), the second one faulty."""
    root = np.random.default_rng(seed).standard_normal((count, M, M))
    made = root @ np.swapaxes(root, 1, 2) + np.eye(M)
    made[1] = FAULTY
    return made


def test_the_faulty_matrix_is_refused_by_the_library_itself() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.inv(FAULTY)


@pytest.mark.parametrize("function", [cholesky, inverse, lambda m: solve(m, np.ones((len(m), M)))])
def test_each_of_the_others_is_as_alone(function) -> None:
    made = matrices(0, 4)
    found = function(made)
    assert not np.isfinite(found[1]).any()
    for i in (0, 2, 3):
        np.testing.assert_allclose(found[i], function(made[i : i + 1])[0], rtol=1e-9)


def test_rows_together() -> None:
    made = matrices(1, 4)
    rng = np.random.default_rng(2)
    kind, padded = np.array([0, 0]), rng.standard_normal((4, 2 * M, 3))
    found, _ = segment_piece(made[:, None], kind, padded, 2 * M)
    assert not np.isfinite(found.constant[1])
    for i in (0, 2, 3):
        alone, _ = segment_piece(made[i : i + 1, None], kind, padded[i : i + 1], 2 * M)
        np.testing.assert_allclose(found.constant[i], alone.constant[0], rtol=1e-9)


def test_noise_within_bins() -> None:
    made, rng = matrices(3, 4), np.random.default_rng(4)
    chunks = rng.standard_normal((20, M))
    for value in (
        FastScatter(chunks.T @ chunks, len(chunks), np.eye(M), 1.0).log_likelihood_of(made),
        chunk_log_likelihood(made, chunks, np.ones((1, len(chunks)))),
    ):
        assert not np.isfinite(value[1])
        # ln p of the chunks under each covariance, written out.
        for i in (0, 2, 3):
            squares = np.einsum("ci,ij,cj->", chunks, np.linalg.inv(made[i]), chunks)
            log_det = np.linalg.slogdet(2.0 * np.pi * made[i])[1]
            assert value[i] == pytest.approx(-0.5 * (squares + len(chunks) * log_det))
