"""The package's own R-hat and effective sizes against ArviZ's and emcee's."""

from __future__ import annotations

import arviz as az
import numpy as np
import pytest
from emcee.autocorr import integrated_time

from mpam_calib.posterior.chains.effective import autocorrelation_time, ess_bulk, ess_tail, rhat


def series(rho: float, shape: tuple[int, int], repeated: bool) -> np.ndarray:
    """AR(1) along the draws; ``repeated`` as a sampler repeats what it rejects."""
    z = np.random.default_rng(0).standard_normal(shape)
    x = z.copy()
    for t in range(1, shape[1]):
        x[:, t] = rho * x[:, t - 1] + np.sqrt(1.0 - rho**2) * z[:, t]
    return np.repeat(x, 2, axis=1)[:, : shape[1]] if repeated else x


@pytest.mark.parametrize("rho", [-0.7, -0.3, 0.0, 0.3, 0.6, 0.9, 0.99])
@pytest.mark.parametrize("shape", [(2, 8), (4, 40), (128, 40), (8, 500), (64, 240)])
@pytest.mark.parametrize("repeated", [False, True])
def test_same_figures(rho, shape, repeated):
    x = series(rho, shape, repeated)
    assert rhat(x) == pytest.approx(az.rhat(x), rel=1e-10)
    assert ess_bulk(x) == pytest.approx(az.ess(x, method="bulk"), rel=1e-10)
    assert ess_tail(x) == pytest.approx(az.ess(x, method="tail"), rel=1e-10)
    tau = integrated_time(x.T[:, :, None], quiet=True, tol=0)[0]
    assert autocorrelation_time(x) == pytest.approx(tau, rel=1e-10)


def test_an_odd_number_of_draws_is_ranked_whole():
    x = series(0.3, (16, 201), False)
    assert rhat(x) == pytest.approx(az.rhat(x), rel=1e-3)
    assert ess_bulk(x) == pytest.approx(az.ess(x, method="bulk"), rel=1e-2)


def test_skewed_draws_are_ranked():
    x = np.exp(3.0 * series(0.5, (8, 200), True))
    assert rhat(x) == pytest.approx(az.rhat(x), rel=1e-10)
    assert ess_tail(x) == pytest.approx(az.ess(x, method="tail"), rel=1e-10)
