"""Refits by weighted draws: what they must find, and where they must say that they did not."""

from __future__ import annotations

import numpy as np
from scipy import stats

from mpam_calib.posterior.chains.effective import effective_share
from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.chains.rounds import Rounds
from mpam_calib.posterior.chains.weighing import GOOD_SHARE, LOOKING, refit, weigh
from mpam_calib.posterior.density.mode import Mode

from .test_proposal import bent, log_bent

AT_THE_BEND = [Mode(np.zeros(2), 0.0, np.diag([1.0, 0.01]))]


def rng(seed: int) -> np.random.RandomState:
    return np.random.RandomState(seed)


def test_a_normal_density_fits_at_once() -> None:
    mode = Mode(np.zeros(4), 0.0, np.eye(4))
    found = weigh([mode], lambda x: -0.5 * np.sum(x**2, axis=1), rng(0))
    assert found.fits
    assert len(found.shares) <= 3


def test_a_bend_is_given_up_from_its_mode_and_followed_from_what_walkers_met() -> None:
    """u₂ ~ N(u₁², 0.1²): ten widths off the axis at one sd, of which Laplace's mixture draws little.

    The walkers never went beyond one sd on one side, where 16 % of the density are.
    """
    x = bent(8000)
    x = x[x[:, 0] < 1.0]
    start = refit(AT_THE_BEND, x, np.full(len(x), 1.0 / len(x)), LOOKING)
    for seed in range(6):
        assert not weigh(AT_THE_BEND, log_bent, rng(seed)).fits
        found = weigh(AT_THE_BEND, log_bent, rng(seed), start)
        assert max(found.shares[-2:]) > GOOD_SHARE
        drawn = found.mixture.draw(20_000, rng(seed + 100))
        assert np.mean(drawn[:, 0] > 1.0) > 0.12
        weight = np.exp(log_bent(drawn) - found.mixture.log_density(drawn))
        assert abs(np.mean(weight * (drawn[:, 0] > 1.0)) - stats.norm.sf(1.0)) < 0.05


def test_a_place_that_only_an_earlier_round_met_is_not_covered() -> None:
    """A tenth of the mass far off, where the last mixture has next to nothing and drew nothing."""
    far = np.array([8.0, 0.0])
    both, near = (StudentMixture.build([np.zeros(2), far][:k], [np.eye(2)] * k) for k in (2, 1))

    def log_p(x: np.ndarray) -> np.ndarray:
        parts = [stats.multivariate_normal.logpdf(x, mean) for mean in (np.zeros(2), far)]
        return np.asarray(np.logaddexp(parts[0] + np.log(0.9), parts[1] + np.log(0.1)))

    rounds = Rounds(2)
    rounds.draw(both, 3000, log_p, rng(0))
    assert effective_share(rounds.draw(near, 3000, log_p, rng(1))) > GOOD_SHARE
    assert rounds.covered(near) < 0.1
    assert rounds.covered(both) > 0.5
    # A proposal that misses a tenth takes nothing from what the other has there.
    assert abs(rounds.log_integral) < 0.05
    assert abs(rounds.weight @ (rounds.drawn[:, 0] > 4.0) - 0.1) < 0.02


def folded(u: np.ndarray) -> np.ndarray:
    """Four thin directions bent along four wide ones: a sheet that hundreds of normals would have to tile."""
    wide, thin = u[:, :4], u[:, 4:]
    return stats.norm.logpdf(wide).sum(axis=1) + stats.norm.logpdf(thin, 3.0 * wide**2, 0.05).sum(axis=1)


def test_what_no_mixture_follows_is_given_up() -> None:
    mode = Mode(np.zeros(8), float(folded(np.zeros((1, 8)))[0]), np.diag([1.0] * 4 + [0.0025] * 4))
    found = weigh([mode], folded, rng(0))
    assert not found.fits
    assert max(found.shares[-2:]) < GOOD_SHARE
    assert np.isfinite(found.mixture.log_density(found.mixture.draw(100, rng(1)))).all()
