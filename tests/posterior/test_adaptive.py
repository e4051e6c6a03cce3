"""The evidence of cheap densities by rounds of many weighted draws."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special, stats

from mpam_calib.posterior.evidence.adaptive import ENOUGH, MOST_ROUNDS, error_of, weigh_adaptively

from .densities import Curved, Gaussian, Sheets, Skewed, dimensions_of, mode_of


@pytest.mark.parametrize(
    "density",
    [Gaussian(12), Skewed(tuple(np.linspace(1.5, 6.0, 10))), Curved(0.5)],
    ids=["normal", "skewed", "curved"],
)
def test_the_error_is_what_it_says(density: Gaussian | Skewed | Curved) -> None:
    """Eight seeds: a few hundredths of a nat, no more than twice what is stated, and no bias."""
    mode = mode_of(density, dimensions_of(density))
    found = [weigh_adaptively(density, mode, np.random.RandomState(seed)) for seed in range(8)]
    errors = np.array([rounds.log_integral - density.exact for rounds, _ in found])
    stated = np.array([error for _, error in found])
    assert np.abs(errors).max() < 0.1
    assert np.sqrt(np.mean(errors**2)) < 2.0 * stated.mean()
    assert abs(errors.mean()) < 3.0 * stated.mean() / np.sqrt(len(errors))
    assert all(rounds.count < MOST_ROUNDS for rounds, _ in found)


@pytest.mark.long
def test_what_no_round_met_is_told_of() -> None:
    """Eight of twelve dimensions on sheets 0.02 thin and bent: nats are missed, and the error says so."""
    density = Sheets()
    mode = mode_of(density, 12)
    for seed in range(3):
        rounds, error = weigh_adaptively(density, mode, np.random.RandomState(seed))
        assert rounds.count == MOST_ROUNDS
        assert 1.0 < abs(rounds.log_integral - density.exact) < 3.0 * error


def test_error_of_normal_weights() -> None:
    """Log-normal weights, whose mean is known: within thrice the error, which is about their scatter."""
    rng = np.random.default_rng(0)
    for sd in (0.3, 1.0, 2.0):
        log_weight = sd * rng.standard_normal(20_000)
        off = special.logsumexp(log_weight) - np.log(20_000) - 0.5 * sd**2
        scatter = np.sqrt(np.expm1(sd**2) / 20_000)
        assert abs(off) < 3.0 * error_of(log_weight)
        assert 0.5 * scatter < error_of(log_weight) < 10.0 * scatter


def test_a_tail_without_a_variance_is_an_error() -> None:
    """Pareto weights of shape 0.9: the mean is most often some tenths too small, and the error as large."""
    short = []
    for seed in range(20):
        weight = stats.genpareto.rvs(0.9, size=20_000, random_state=seed)
        error, off = error_of(np.log(weight)), np.log(weight.mean() / stats.genpareto.mean(0.9))
        short.append(abs(off) < 2.0 * error)
        assert error > ENOUGH
    assert np.mean(short) > 0.8
