"""Readings beside their fit: each at its own pressure, and over the width that it is a mean of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from model import build

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.prediction.fitted import fitted_force
from mpam_calib.run.observed import DRAWS, observed_readings
from mpam_calib.run.view import view_of
from mpam_calib.specimen.oddities import stroke_stray
from mpam_calib.units import KPA

from .small import K_F, L0, static_force

NOISE_N = 0.1


@pytest.fixture(scope="module")
def calibration() -> Calibration:
    """Loops whose pressure wanders by a twentieth along each stroke, in bins of two readings."""
    rng = np.random.default_rng(2)
    loops = build.loops(rows=32, ripple=0.05)
    force = static_force(loops.pressure_Pa / KPA, 1e3 * loops.displacement_m / L0)
    force = force + K_F * np.abs(force) * loops.branch + NOISE_N * rng.standard_normal(len(force))
    made = build.with_force(build.specimen(None, loops), force)
    return calibrate(
        replace(made, sensors=made.sensors.model_copy(update={"force_sd_N": NOISE_N})),
        max_steps=60,
        ess_wanted=150.0,
        options=build.PLAIN,
    )


@pytest.fixture(scope="module")
def observed(calibration: Calibration) -> pd.DataFrame:
    return observed_readings(calibration)[0]


def test_the_band_of_a_reading_is_that_at_its_own_pressure(
    calibration: Calibration, observed: pd.DataFrame
) -> None:
    """Wherever the pressure went, a true simulation's band of 90 % holds the reading, and is no wider.

    Each reading is a mean of two, and has the noise of such a mean.
    """
    assert (observed["pressure_kPa"] / observed["level_kPa"] - 1.0).abs().max() > 0.03
    held = observed["force_N"].between(observed["low_N"], observed["high_N"])
    assert 0.83 < held.mean() < 0.98
    width = observed["high_N"] - observed["low_N"]
    one = 2.0 * 1.645 * NOISE_N / np.sqrt(2.0)
    assert 0.9 * one < width.median() < 1.3 * one


def test_a_mean_of_readings_is_compared_with_the_mean_of_the_fit(
    calibration: Calibration, observed: pd.DataFrame
) -> None:
    """The mean of a curve that bends is not its value at the middle."""
    bins = calibration.target.data.bins
    assert bins is not None and bins.count.max() == 2.0
    draws = calibration.draws.thin(DRAWS)
    ends, middle = (fitted_force(calibration.model, draws, r)[0] for r in (bins.readings, bins.middle()))
    mean = ends.reshape(2, -1).mean(axis=0)
    np.testing.assert_allclose(observed["fitted_N"], mean, rtol=1e-9)
    assert np.abs(mean - middle).max() > 1e-3


def test_the_page_has_the_run_s_own_demands_and_ends(calibration: Calibration) -> None:
    bands = calibration.bands()
    view = view_of(calibration, bands)
    assert view.convergence.ess_wanted == 150.0
    loops, levels = calibration.specimen.loops, calibration.specimen.levels_Pa
    assert loops is not None
    strays = [stroke_stray(loops, levels, index) / KPA for index in range(3)]
    np.testing.assert_allclose(view.strays_kPa, strays)
    grid = bands.loc[bands["quantity"] == "force_N", "contraction"]
    assert grid.max() <= view.curves_end < 0.6
