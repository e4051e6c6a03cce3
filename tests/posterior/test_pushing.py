"""A muscle that pushes in part of its stroke: its friction turns with the force's own sign."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.posterior.density.target import build_target, locate
from mpam_calib.specimen.declaration import Sensors

from . import sbc
from .test_sbc import MODELS

SEEDS = (62, 134, 170, 3)
"""Truths of the shared-rate exponential law: three whose muscle also pushes (the first from -186 N to 296 N;
to the others' rates no climb from the middle of the priors led), and one whose muscle pulls."""


@pytest.mark.parametrize("seed", SEEDS)
def test_the_truth_is_as_probable_as_the_mode(seed: int) -> None:
    """Taken to pull everywhere, the first muscle was fitted with noise of many newtons: 4 million nats."""
    declared, options, shape = MODELS["shared-rate exponential"]
    rng = np.random.default_rng([seed, 99])
    made, blueprint = sbc.design(declared, options, **shape)
    u, _, made = sbc.simulate(made, blueprint, rng)
    target, modes = locate(build_target(made, blueprint), np.random.default_rng([seed, 0]))
    # Twice the distance is chi-squared with as many degrees of freedom as there are sampled parameters.
    above = modes[0].log_posterior - target.log_posterior(u)[0]
    assert -1e-3 < above < 15.0


def test_a_slack_reading_has_the_friction_of_one_that_pulls() -> None:
    """A floor of 0 N is recorded as 0 N, which says nothing of the direction."""
    made = build.specimen({"law": "linear", "order": 2}, build.loops((100.0, 150.0), 12.0, 20))
    assert made.loops is not None
    force = np.maximum(30.0 - np.arange(len(made.loops.force_N)) % 20 * 2.0, 0.0)
    loops = replace(made.loops, force_N=force, censored=force == 0.0)
    made = replace(made, loops=loops, sensors=Sensors(force_floor_N=0.0))
    target = build_target(made, draw_blueprint(made, build.PLAIN))
    assert target.data.bins is not None and target.guide.bins is not None
    slack = np.tile(target.data.bins.slack, 2)
    assert slack.any() and not slack.all()
    assert np.all(target.guide.bins[slack] > 0.0)
    np.testing.assert_array_equal(target.guide.bins[~slack], np.tile(target.data.bins.force, 2)[~slack])
