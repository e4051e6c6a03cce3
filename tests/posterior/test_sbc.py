"""Simulation-based calibration of what calibrate draws (see sbc.py)."""

from __future__ import annotations

import numpy as np
import pytest
from model import build

from mpam_calib.model.blueprint import Options
from mpam_calib.posterior.density.target import build_target, locate

from . import sbc

LINEAR = {"law": "linear", "order": 2}
MODELS = {
    "linear law, Coulomb": (LINEAR, build.PLAIN, {}),
    "shared-rate exponential": ({"law": "exponential", "order": 2}, build.PLAIN, {}),
    "strand friction": ({**LINEAR, "friction": "strand"}, build.PLAIN, {}),
    "correlated noise": (LINEAR, Options(remainder=False), {"rows": 120, "dt": 0.05}),
}


def test_the_band_holds_what_it_promises():
    """Uniform ranks leave it in 1 % of families; ranks of a narrowed normal nearly always."""
    rng = np.random.default_rng(1)
    names = [f"q{i}" for i in range(8)]
    left = np.mean([bool(sbc.outside(names, rng.integers(0, sbc.L + 1, (60, 8)))) for _ in range(1000)])
    # Binomial sd √(0.01/1000) = 0.003; families of independent quantities.
    assert left < 0.01 + 4 * 0.0032
    truth, draws = rng.standard_normal((500, 8, 1)), 0.8 * rng.standard_normal((500, 8, sbc.L))
    assert sbc.outside(names, (draws < truth).sum(axis=2))


def test_ranks_of_truth_are_uniform_in_eighty_replicates():
    names, ranks, narrowed = sbc.run(*MODELS["linear law, Coulomb"][:2], 80)
    assert len(names) == 10
    assert sbc.outside(names, ranks) == {}
    assert "joint distance" in sbc.outside(names, narrowed)


def test_likelihood_of_bins_is_that_of_rows_where_bins_lose_nothing():
    made, blueprint = sbc.design(*MODELS["strand friction"][:2])
    rng = np.random.default_rng(8)
    *_, made = sbc.simulate(made, blueprint, rng)
    target, _ = locate(build_target(made, blueprint), rng)
    u = 0.3 * rng.standard_normal((6, len(target.model.names)))
    eta = 0.3 * rng.standard_normal((6, sum(target.model.linear_sizes)))
    values = target.model.values(u)
    rows, bins = (each(target, made, values, eta) for each in (sbc.of_rows, sbc.of_bins))
    assert np.ptp(rows) > 10.0
    np.testing.assert_allclose(bins, rows, rtol=1e-8)


@pytest.mark.long
@pytest.mark.parametrize("model", MODELS)
def test_ranks_of_truth_are_uniform(model):
    declared, options, shape = MODELS[model]
    names, ranks, narrowed = sbc.run(declared, options, 500, **shape)
    assert sbc.outside(names, ranks) == {}
    fired = sbc.outside(names, narrowed)
    assert "joint distance" in fired
    assert len(fired) > 1
