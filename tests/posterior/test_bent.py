"""A bent posterior: the sampler's far tail against emcee's own stretch move, long and from wide starts."""

from __future__ import annotations

import emcee
import numpy as np
from model import build

from mpam_calib.posterior.mode import evaluate
from mpam_calib.posterior.sampling import sample
from mpam_calib.posterior.target import build_target, locate

from . import sbc

SEED, WALKERS, STEPS = 47, 96, 1200
"""Two rates that three levels hardly tell apart: their ridge is a hundred times as long as wide, and bent."""


def test_the_tail_of_a_ridge_is_drawn() -> None:
    """The share of the posterior beyond the truth, a tenth; a mixture alone finds some thousandths of it."""
    rng = np.random.default_rng([SEED, 99])
    made, blueprint = sbc.design({"law": "exponential", "order": 2}, build.PLAIN)
    truth, _, made = sbc.simulate(made, blueprint, rng)
    target, modes = locate(build_target(made, blueprint), np.random.default_rng([SEED, 0]))
    gap = target.model.names.index("gap")
    spread = np.sqrt(np.diag(modes[0].covariance))
    starts = modes[0].u + spread * rng.standard_normal((WALKERS, len(spread)))
    plain = emcee.EnsembleSampler(WALKERS, len(spread), lambda u: evaluate(target, u), vectorize=True)
    plain.random_state = np.random.RandomState(SEED).get_state()
    plain.run_mcmc(starts, STEPS)
    beyond = float(np.mean(plain.get_chain(discard=STEPS // 3)[..., gap] < truth[0, gap]))
    assert 0.05 < beyond < 0.2
    drawn = sample(target, modes, SEED, max_steps=800)
    assert drawn.converged
    shares = np.mean(drawn.chain[..., gap] < truth[0, gap], axis=(1, 2))
    assert abs(shares.mean() - beyond) < 0.3 * beyond
    assert shares.max() < 2.0 * shares.min()
