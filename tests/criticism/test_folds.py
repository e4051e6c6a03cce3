"""Levels left out in folds: each once, and their joint density with the error of its sum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mpam_calib.criticism.fitting.folds import FEW_FOLDS, FOLDS, MANY, folds_of, log_densities, total


@pytest.mark.parametrize("count", [3, 4, 5, 8, MANY - 1, MANY, 15, 31])
def test_each_label_is_left_out_once(count: int) -> None:
    labels = 3 * np.arange(count) + 2
    parts = folds_of(labels)
    assert sorted(np.concatenate(parts).tolist()) == labels.tolist()
    assert len(parts) == (FEW_FOLDS if count >= MANY else min(FOLDS, count))
    # Where there are neighbours they stay: no fold has to fill a gap of two.
    assert all((np.diff(part) > 3).all() for part in parts)


def covariance(sizes: list[int], shared: float, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of rows in groups, with an offset of its own for each group and one that all share."""
    label = np.repeat(np.arange(len(sizes)), sizes)
    label = rng.permutation(label)
    own = label[:, None] == label
    return label, np.eye(len(label)) + 0.5 * own + shared**2


def test_the_parts_make_up_the_joint_density() -> None:
    rng = np.random.default_rng(4)
    label, cov = covariance([4, 1, 7], 0.8, rng)
    residual = rng.multivariate_normal(np.zeros(12), cov)
    parts = log_densities(residual, cov, label + 10)
    assert parts.shape == (3,)
    assert total(parts)[0] == pytest.approx(stats.multivariate_normal(cov=cov).logpdf(residual))
    # In the order of the rows: the first label's part is its own density, the second's given the first.
    order = np.argsort(label, kind="stable")
    parts = log_densities(residual[order], cov[np.ix_(order, order)], label[order])
    first = order[:4]
    expected = stats.multivariate_normal(cov=cov[np.ix_(first, first)]).logpdf(residual[first])
    assert parts[0] == pytest.approx(expected)


def test_the_error_of_the_sum_is_that_of_its_parts() -> None:
    """Levels that share an offset: over many tests the stated error is the sum's scatter, to a tenth."""
    rng = np.random.default_rng(8)
    label, cov = covariance([5] * 20, 3.0, rng)
    made = rng.multivariate_normal(np.zeros(100), cov, size=1500)
    found = np.array([total(log_densities(one, cov, label)) for one in made])
    assert np.sqrt(np.mean(found[:, 1] ** 2)) == pytest.approx(found[:, 0].std(), rel=0.1)
