"""What a new reading adds: white and correlated, grown with the force, with heavy tails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from mpam_calib.posterior.likelihood.covariance import lasting_share
from mpam_calib.prediction.reading_noise import FURTHEST, ReadingNoise

N = 40_000
FORCE = np.array([0.0, 50.0])


def noise(**values: float) -> ReadingNoise:
    return ReadingNoise({name: np.full((N, 1), value) for name, value in values.items()}, 25.0)


def draws(made: ReadingNoise) -> np.ndarray:
    return made.draw(np.broadcast_to(FORCE, (N, 2)), np.random.default_rng(0))


def test_white_and_correlated_noise_add_up() -> None:
    made = noise(noise_sd_N=0.3, noise_corr_sd_N=0.4)
    assert draws(made).std(axis=0) == pytest.approx([0.5, 0.5], rel=0.02)
    assert made.sd(np.zeros((N, 2)))[0, 0] == pytest.approx(0.5)


def test_a_mean_of_readings_has_less_white_noise_alone() -> None:
    made = replace(noise(noise_sd_N=0.9, noise_corr_sd_N=0.4), averaged=np.array([1.0, 9.0]))
    expected = [np.hypot(0.9, 0.4), 0.5]
    assert draws(made).std(axis=0) == pytest.approx(expected, rel=0.02)
    assert made.sd(np.zeros((N, 2)))[0] == pytest.approx(expected)
    tailed = draws(replace(noise(noise_sd_N=0.9, noise_dof=3.0), averaged=9.0))[:, 0]
    assert stats.kstest(tailed / 0.3, stats.t(3.0).cdf).pvalue > 1e-3


def test_of_noise_that_lasts_a_mean_keeps_what_its_readings_share() -> None:
    """Means of two and of forty readings, 0.1 s apart, of noise that lasts 0.5 s: reckoned and drawn."""
    rows, dt, time = np.array([2.0, 40.0]), np.array([0.1, 0.1]), 0.5
    lasting = lasting_share(rows, dt, np.full(N, time))
    apart = np.abs(np.subtract.outer(np.arange(40), np.arange(40))) * 0.1
    kernel = np.exp(-apart / time)
    expected = [np.sqrt(kernel[:2, :2].mean()), np.sqrt(kernel.mean())]
    np.testing.assert_allclose(lasting[0], expected)
    made = replace(noise(noise_sd_N=0.9, noise_corr_sd_N=0.4), averaged=rows, lasting=lasting)
    assert draws(made).std(axis=0) == pytest.approx(
        np.hypot(0.9 / np.sqrt(rows), 0.4 * np.array(expected)), rel=0.02
    )


def test_it_grows_with_the_force() -> None:
    """At twice the force scale and a growth of one: √5 times the noise."""
    made = noise(noise_sd_N=0.3, noise_growth=1.0)
    assert draws(made).std(axis=0) == pytest.approx([0.3, 0.3 * np.sqrt(5.0)], rel=0.02)


def test_heavy_tails_grow_with_the_force_as_well() -> None:
    found = draws(noise(noise_sd_N=0.3, noise_growth=1.0, noise_dof=3.0))
    for column, scale in enumerate((0.3, 0.3 * np.sqrt(5.0))):
        assert stats.kstest(found[:, column] / scale, stats.t(3.0).cdf).pvalue > 1e-3


def test_heavy_tails() -> None:
    found = draws(noise(noise_sd_N=0.3, noise_dof=3.0))[:, 0]
    assert stats.kstest(found / 0.3, stats.t(3.0).cdf).pvalue > 1e-3
    assert stats.kstest(found / 0.3, stats.norm.cdf).pvalue < 1e-6
    assert np.abs(draws(noise(noise_sd_N=0.3, noise_dof=0.5))).max() <= 0.3 * FURTHEST
