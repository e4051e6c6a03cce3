"""Free contractions: readings of a contraction, not of a force."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build
from scipy import stats

from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.posterior.density.target import build_target
from mpam_calib.posterior.likelihood.points import floor_of, gather_points
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import BlockedForce, ForceMap, FreeContraction

NOISE = 0.5
WRONG = 0.01
"""The share of slack flags that may be wrong, as the model states it."""


def test_a_muscle_that_does_not_contract_may_push() -> None:
    """A contraction of 0 says that the force at 0 is none or pushes: by quadrature over one modulus."""
    pressure = np.linspace(2e4, 2e5, 12)
    free = FreeContraction(np.array([2e4, 3e4]), np.zeros(2))
    blocked = BlockedForce(pressure, np.zeros(12), np.zeros(12, dtype=bool))
    made = build.specimen(
        {"law": "constant", "order": 1, "friction": "none", "strain": "stretch"},
        levels_kPa=(20.0, 100.0, 200.0),
        blocked_force=blocked,
        free_contraction=free,
        sensors=Sensors(force_sd_N=NOISE),
    )
    blueprint = draw_blueprint(made, build.PLAIN)
    values = {"noise_sd_N": np.array([[NOISE]]), "contraction_sd": np.array([[0.002]])}
    chain = build_target(made, blueprint).model.chain
    assert chain is not None
    rows = gather_points(made)
    assert rows is not None
    terms = chain.terms(values, rows.readings)
    f, A = terms.fixed[0], terms.columns[0][:, 0]
    # Such that the muscle pushes with 4 N at the higher of the two pressures.
    eta = (-4.0 - f[-1]) / A[-1]
    force = f[:12] + A[:12] * eta + NOISE * np.random.default_rng(0).standard_normal(12)
    made = replace(made, blocked_force=BlockedForce(pressure, force, force < -1e9))
    target = build_target(made, blueprint)
    grid = np.linspace(eta - 1.0, eta + 1.0, 20_001)
    heights = stats.norm.logpdf(grid)
    for i in range(12):
        heights = heights + stats.norm.logpdf(force[i], f[i] + A[i] * grid, NOISE)
    for i in (12, 13):
        heights = heights + np.log((1.0 - WRONG) * stats.norm.cdf(0.0, f[i] + A[i] * grid, NOISE) + WRONG)
    exact = np.log(np.trapezoid(np.exp(heights - heights.max()), grid)) + heights.max()
    assert target.log_likelihood(values)[0] == pytest.approx(exact, abs=0.01)


def test_contractions_that_noise_lifts_above_none() -> None:
    pressure = np.repeat(np.arange(1.0, 9.0) * 2e4, 4)
    true = np.maximum(0.4 - 3e4 / pressure, 0.0) * (pressure > 7e4)
    noise = 0.002 * np.random.default_rng(0).standard_normal(len(true))
    free = FreeContraction(pressure, np.maximum(true + noise, 0.0))
    made = build.specimen(levels_kPa=(20.0, 160.0), free_contraction=free)
    points = gather_points(made)
    assert points is not None
    assert 0.2 < np.mean(free.contraction[true == 0.0] == 0.0) < 0.8
    assert np.array_equal(points.censored, true == 0.0)


def test_they_do_not_tell_the_floor_of_a_force() -> None:
    """Flagged rows of a map read 0.7 N, and no floor is declared."""
    contraction = np.linspace(0.0, 0.4, 12)
    force = np.maximum(20.0 - 80.0 * contraction, 0.7)
    none = np.zeros(12, dtype=np.int64)
    grid = ForceMap(np.full(12, 1e5), contraction, force, none, none, force == 0.7)
    free = FreeContraction(np.full(9, 1e4), np.zeros(9))
    points = gather_points(build.specimen(levels_kPa=(100.0,), force_map=grid, free_contraction=free))
    assert points is not None and points.censored[-9:].all()
    assert floor_of(None, points) == pytest.approx(0.7)
