"""Workers inside another pool's worker."""

from __future__ import annotations

from multiprocessing import get_context

import numpy as np
from model import build
from threadpoolctl import threadpool_limits

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.posterior.sampling import sample
from mpam_calib.posterior.target import build_target, locate


def chain(seed: int) -> np.ndarray:
    """A short posterior sample, in processes of its own where it may have some."""
    made = build.specimen({"law": "linear", "order": 2}, build.loops((100.0, 150.0), 12.0, 20))
    noise = np.random.default_rng(seed).standard_normal(len(made.loops.force_N))
    made = build.with_force(made, 20.0 + noise)
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    target, modes = locate(target, np.random.default_rng(seed))
    return sample(target, modes, seed, max_steps=40).chain


def test_a_worker_that_may_have_no_workers_draws_the_same():
    with get_context("fork").Pool(1, initializer=threadpool_limits, initargs=(1,)) as pool:
        inside = pool.apply(chain, (3,))
    np.testing.assert_array_equal(inside, chain(3))
