"""A bent posterior: the sampler's far tail against emcee's own stretch move, long and from wide starts."""

from __future__ import annotations

import emcee
import numpy as np
import pytest
from model import build
from scipy import stats

from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.chains.sampling import sample
from mpam_calib.posterior.chains.weighing import CHECKED, LIGHT, heaviness
from mpam_calib.posterior.density.mode import evaluate
from mpam_calib.posterior.density.target import build_target, locate

from . import sbc

WALKERS, STEPS = 96, 4000


@pytest.mark.long
@pytest.mark.parametrize("seed", [47, 63])
def test_the_tail_of_a_ridge_is_drawn(seed: int) -> None:
    """The tenth of the posterior at the ridge's far end; a mixture alone finds some thousandths of it, and
    where it seems to fit (the second seed), half.

    Two rates that three levels hardly tell apart: their ridge is a hundred times as long as wide, and bent.
    """
    rng = np.random.default_rng([seed, 99])
    made, blueprint = sbc.design({"law": "exponential", "order": 2}, build.PLAIN)
    *_, made = sbc.simulate(made, blueprint, rng)
    target, modes = locate(build_target(made, blueprint), np.random.default_rng([seed, 0]))
    gap = target.model.names.index("gap")
    spread = np.sqrt(np.diag(modes[0].covariance))
    starts = modes[0].u + spread * rng.standard_normal((WALKERS, len(spread)))
    plain = emcee.EnsembleSampler(WALKERS, len(spread), lambda u: evaluate(target, u), vectorize=True)
    plain.random_state = np.random.RandomState(seed).get_state()
    plain.run_mcmc(starts, STEPS)
    end = np.quantile(plain.get_chain(discard=STEPS // 3)[..., gap], 0.1)
    drawn = sample(target, modes, seed, max_steps=800)
    assert drawn.converged
    shares = np.mean(drawn.chain[..., gap] < end, axis=(1, 2))
    # Steps that remember some 200 others: the stretch move's own tenth is known to a sixth of it.
    assert abs(shares.mean() - 0.1) < 0.03
    assert shares.max() < 2.0 * shares.min()


def test_a_tail_that_a_proposal_misses_is_seen_and_none_where_none_is() -> None:
    """A tenth of the mass far outside a normal proposal; a proposal too wide, or the posterior itself."""
    proposal = StudentMixture.build([np.zeros(3)], [np.eye(3)])
    far = np.array([4.0, 0.0, 0.0])

    def missed(x: np.ndarray) -> np.ndarray:
        both = [stats.multivariate_normal.logpdf(x, mean) for mean in (np.zeros(3), far)]
        return np.asarray(np.logaddexp(both[0] + np.log(0.9), both[1] + np.log(0.1)))

    def narrow(x: np.ndarray) -> np.ndarray:
        return np.asarray(stats.multivariate_normal.logpdf(x, np.zeros(3), 0.8))

    for seed in range(5):
        x = proposal.draw(CHECKED, np.random.RandomState(seed))
        found = [heaviness(p(x) - proposal.log_density(x)) for p in (missed, narrow, proposal.log_density)]
        assert found[0] > LIGHT > max(found[1:])
