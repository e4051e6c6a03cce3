"""A muscle that pushes in part of its stroke: its friction turns with the force's own sign."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.posterior.target import build_target, locate

from . import sbc
from .test_sbc import MODELS

SEEDS = (62, 3)
"""Truths of the shared-rate exponential law: one whose force reaches from -186 N to 296 N, and another."""


@pytest.mark.parametrize("seed", SEEDS)
def test_the_truth_is_as_probable_as_the_mode(seed: int) -> None:
    """Taken to pull everywhere, the first muscle was fitted with noise of many newtons: 4 million nats."""
    declared, options, shape = MODELS["shared-rate exponential"]
    rng = np.random.default_rng([seed, 99])
    made, blueprint = sbc.design(declared, options, **shape)
    u, _, made = sbc.simulate(made, blueprint, rng)
    target, modes = locate(build_target(made, blueprint), np.random.default_rng([seed, 0]))
    # Twice the distance is chi-squared with as many degrees of freedom as there are sampled parameters.
    assert modes[0].log_posterior - target.log_posterior(u)[0] < 15.0
