"""What data move and what they leave where the prior put it: the dead-band beside free moduli and others."""

from __future__ import annotations

import numpy as np
import pytest
from model import build

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.posterior.density.target import build_target, locate, predict_force

DEAD_BAND = 8e3
STRAINS = {"law": "linear", "order": 3, "effects": ("dead_band",)}
STRETCHES = {**STRAINS, "order": 4, "kinematics": "constant_thickness", "strain": "stretch"}
"""The thesis's own simulation."""
TENSILE = {
    "law": "constant", "order": 2, "effects": ("dead_band",),
    "moduli": "tensile", "E_Pa": (5e4, 2e4), "E_rel_sd": 0.1,
}  # fmt: skip


def share_of_the_prior_left(declared: dict, seed: int) -> tuple[float, float]:
    """(posterior sd over prior sd of P_DB in normal coordinates, its mode in Pa), by Laplace's method."""
    recorded = build.loops((50.0, 100.0, 150.0, 200.0), 11.0, 16)
    n = len(recorded.time_s)
    made = build.with_force(build.specimen(declared, recorded), np.full(n, 20.0))
    blueprint = draw_blueprint(made, build.PLAIN)
    model = build_target(made, blueprint).model
    rng = np.random.default_rng(seed)
    values = {k: np.array([[v]]) for k, v in (("K_f", 0.06), ("P_DB_kPa", DEAD_BAND), ("noise_sd_N", 0.2))}
    eta = 0.2 * rng.standard_normal((1, model.linear_sizes[0]))
    force = predict_force(model, values, eta, build.rows_of(recorded))[0]
    made = build.with_force(made, force + 0.2 * rng.standard_normal(n))
    target, modes = locate(build_target(made, blueprint), np.random.default_rng(0))
    i = target.model.names.index("P_DB_kPa")
    mode = float(target.model.values(modes[0].u[None])["P_DB_kPa"][0, 0])
    return float(np.sqrt(modes[0].covariance[i, i])), mode


@pytest.mark.parametrize("seed", range(3))
def test_loops_do_not_tell_the_dead_band_from_free_moduli_in_stretches(seed):
    """Its column lies in the span of the b_k: the posterior is about as wide as the prior."""
    left, _ = share_of_the_prior_left(STRETCHES, seed)
    assert 0.7 < left < 1.1


@pytest.mark.parametrize("seed", range(3))
def test_strains_vanish_at_rest_so_that_blocked_force_tells_it(seed):
    """In engineering strain no modulus acts at γ = 0, and there the loops see the pressure alone."""
    left, mode = share_of_the_prior_left(STRAINS, seed)
    assert left < 0.1
    assert abs(mode - DEAD_BAND) < 4.0 * left * 2e4


@pytest.mark.parametrize("seed", range(3))
def test_declared_moduli_tell_the_dead_band(seed):
    left, mode = share_of_the_prior_left(TENSILE, seed)
    assert left < 0.2
    # The prior's sd is a tenth of the top level, 20 kPa.
    assert abs(mode - DEAD_BAND) < 4.0 * left * 2e4
