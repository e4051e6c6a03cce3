"""Bridge sampling: known evidences within its errors; it must not be content with a wrong density q."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.density.mode import evaluate
from mpam_calib.posterior.evidence.bridge import Bridge, bridge, bridge_evidence, fitted, independence_chain
from mpam_calib.posterior.evidence.quadrature import Evidence, integrate

from .densities import KNOWN, Gaussian, dimensions_of, mode_of


def exact_draws(count: int, rng: np.random.RandomState) -> np.ndarray:
    return rng.multivariate_normal(np.linspace(-1.0, 1.0, 4), Gaussian().covariance(), count)


def bridged(draws: np.ndarray, q: StudentMixture, seed: int) -> Bridge:
    density = Gaussian()
    return bridge(density, draws, evaluate(density, draws), q, np.random.RandomState(seed))


@pytest.mark.parametrize("name", KNOWN)
def test_known_evidences_within_the_errors_stated(name):
    """Twenty seeds: errors of about the size stated (their root mean square between 0.6 and 1.6 of it)."""
    density = KNOWN[name]
    found = integrate(density, mode_of(density, dimensions_of(density)))
    results = [bridge_evidence(density, found, seed) for seed in range(20)]
    assert all(r.reliable for r in results)
    z = np.array([(r.value - density.exact) / r.error for r in results])
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.6
    assert np.abs(z).max() < 4.0


def test_one_seed_one_figure():
    density = KNOWN["skewed"]
    found = integrate(density, mode_of(density, 3))
    assert bridge_evidence(density, found, 3) == bridge_evidence(density, found, 3)
    assert bridge_evidence(density, found, 3) != bridge_evidence(density, found, 4)


class TwoHills:
    """Two normal densities of equal weight, forty of their sds apart."""

    places = np.array([[-6.0, 0.0], [6.0, 0.0]])
    sd = np.array([0.3, 0.5])

    def log_posterior(self, u: np.ndarray) -> np.ndarray:
        z = (u[:, None, :] - self.places) / self.sd
        return np.logaddexp.reduce(-0.5 * np.sum(z**2, axis=2), axis=1) - np.log(4.0 * np.pi * self.sd.prod())


def test_of_two_hills_more_is_drawn():
    """Of what a density over both draws little lies on them; four times as many do."""
    found = Evidence(0.0, 0.0, np.zeros(2), np.diag([36.1, 0.25]))
    results = [bridge_evidence(TwoHills(), found, seed) for seed in range(10)]
    assert all(r.reliable for r in results)
    z = np.array([r.value / r.error for r in results])
    assert np.abs(z).max() < 4.0


def test_a_narrow_q_is_not_reliable():
    """q ten times too narrow hardly covers a draw: right or not, the figure must say what it is worth."""
    rng = np.random.RandomState(0)
    draws = exact_draws(500, rng)
    mean, covariance = draws.mean(axis=0), np.cov(draws.T)
    assert bridged(draws, fitted(draws), 1).reliable
    assert not bridged(draws, StudentMixture.build([mean], [0.1**2 * covariance]), 1).reliable


def test_a_q_beside_the_posterior_is_not_reliable():
    rng = np.random.RandomState(0)
    draws = exact_draws(500, rng)
    sd = np.sqrt(np.diag(np.cov(draws.T)))
    aside = StudentMixture.build([draws.mean(axis=0) + 8.0 * sd], [np.cov(draws.T)])
    assert not bridged(draws, aside, 1).reliable


def test_draws_that_are_not_the_posterior_s_give_another_evidence():
    """Narrowed by a third: wrong by many of its errors, as the true draws are not."""
    rng = np.random.RandomState(0)
    draws = exact_draws(2000, rng)
    narrowed = draws.mean(axis=0) + (draws - draws.mean(axis=0)) / 1.5
    right, wrong = bridged(draws, fitted(draws), 1), bridged(narrowed, fitted(narrowed), 1)
    assert abs(right.value - Gaussian().exact) < 4.0 * right.error
    assert abs(wrong.value - Gaussian().exact) > 4.0 * wrong.error


def test_the_chain_draws_the_posterior():
    """Means and sds of a skewed density's draws: ψ(a) and √ψ′(a)."""
    from scipy import special

    density = KNOWN["skewed"]
    found = integrate(density, mode_of(density, 3))
    wide = StudentMixture.build([found.mean], [1.3 * found.covariance])
    chain, log_p = independence_chain(density, wide, 20_000, np.random.RandomState(2))
    np.testing.assert_allclose(log_p, density.log_posterior(chain))
    sd = np.sqrt(special.polygamma(1, density.shapes))
    assert np.abs((chain.mean(axis=0) - special.digamma(density.shapes)) / sd).max() < 0.05
    assert chain.std(axis=0) == pytest.approx(sd, rel=0.05)
