"""The evidence by annealed crowds, in dimensions where quadrature does not settle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from mpam_calib.posterior.density.mode import Mode
from mpam_calib.posterior.evidence.annealed import anneal

from .densities import Gaussian, Sheets, Skewed, mode_of


@pytest.mark.parametrize(
    "density", [Gaussian(12), Skewed(tuple(np.linspace(1.5, 6.0, 10)))], ids=["normal", "skewed"]
)
def test_the_error_is_what_it_says(density: Gaussian | Skewed) -> None:
    """Six seeds: errors are small, and stated as at least half as large as they are."""
    mode = mode_of(density, 12 if isinstance(density, Gaussian) else 10)
    found = [anneal(density, mode, seed) for seed in range(6)]
    errors = np.array([f.value - density.exact for f in found])
    assert np.abs(errors).max() < 0.15
    assert np.sqrt(np.mean(errors**2)) < 2.0 * np.mean([f.error for f in found])
    assert max(f.error for f in found) < 0.2


def test_where_crowds_lag_the_error_says_so() -> None:
    """Twelve dimensions, eight of them on sheets 0.02 thin and bent: some nats are lost, and told of."""
    density = Sheets()
    mode = mode_of(density, 12)
    for seed in range(3):
        found = anneal(density, mode, seed)
        off = abs(found.value - density.exact)
        assert off > 1.0
        assert off < 3.0 * found.error


class Fenced:
    """A normal density of which nine tenths of the mode's surroundings are impossible: ln Z = ln 0.1."""

    edge = stats.norm.ppf(0.9)

    def log_posterior(self, u: np.ndarray) -> np.ndarray:
        return np.where(u[:, 0] < self.edge, -np.inf, stats.norm.logpdf(u).sum(axis=1))


def test_where_most_points_are_impossible_at_first() -> None:
    mode = Mode(np.zeros(8), 8.0 * float(stats.norm.logpdf(0.0)), np.eye(8))
    found = anneal(Fenced(), mode, 0)
    assert found.value == pytest.approx(np.log(0.1), abs=0.3)
    assert found.mean[0] > Fenced.edge


def test_a_mode_far_off_ends_with_an_error() -> None:
    mode = Mode(np.full(8, 40.0), 0.0, 1e-4 * np.eye(8))
    found = anneal(Gaussian(8), mode, 0)
    assert found.error > 5.0


def test_two_runs_are_equal_and_two_seeds_are_not() -> None:
    mode = mode_of(Gaussian(8), 8)
    first, again, other = (anneal(Gaussian(8), mode, seed) for seed in (0, 0, 1))
    assert first.value == again.value != other.value


def test_mean_and_covariance_are_the_density_s() -> None:
    density = Gaussian(8)
    found = anneal(density, mode_of(density, 8), 0)
    sd = np.sqrt(np.diag(density.covariance()))
    np.testing.assert_allclose(found.mean, np.linspace(-1.0, 1.0, 8), atol=0.2 * sd.max())
    np.testing.assert_allclose(np.sqrt(np.diag(found.covariance)), sd, rtol=0.2)
