"""Readings beside their fit: each at its own pressure, and over the width that it is a mean of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from model import build

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.model.noise import WHITE
from mpam_calib.model.readings import Readings
from mpam_calib.model.remainder import ROUGH
from mpam_calib.prediction.fitted import fitted_force
from mpam_calib.prediction.reading_noise import ReadingNoise
from mpam_calib.run.observed import DRAWS, _bins_frame, _frame, _noise_of_means, observed_readings
from mpam_calib.run.view import view_of
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.oddities import stroke_stray
from mpam_calib.specimen.recording import ForceMap, FreeContraction
from mpam_calib.units import KPA

from .small import K_F, L0, free_contraction, static_force

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


def test_the_noise_of_a_mean_counts_the_rows_that_were_averaged_on_reading(calibration: Calibration) -> None:
    """Two rows in a bin, each the mean of 25 of the rig's: a tenth of sqrt(2) of one reading's noise."""
    bins = calibration.target.data.bins
    assert bins is not None and bins.count.max() == 2.0
    one = ReadingNoise({WHITE: np.full((1, 1), 0.7)}, 1.0)
    found = _noise_of_means(one, replace(bins, averaged=25), slice(0, 3))
    np.testing.assert_allclose(found.sd(np.zeros((1, 3))), 0.7 / np.sqrt(50.0))


def test_what_the_simulation_misses_holds_each_stroke_s_own_part(calibration: Calibration) -> None:
    bins, draws = calibration.target.data.bins, calibration.draws.thin(50)
    assert bins is not None
    rough = replace(draws, values=draws.values | {ROUGH: np.full((len(draws), 1), 0.3)})
    left, plain = (_bins_frame(bins, calibration, some)[1] for some in (rough, draws))
    np.testing.assert_allclose(left - plain, 0.3**2)


def test_what_the_simulation_misses_is_assessed_where_there_is_a_remainder(calibration: Calibration) -> None:
    """Without one nothing can say so, and no number is not a miss of zero."""
    assert np.isnan(observed_readings(calibration)[1])
    options = build.PLAIN.model_copy(update={"remainder": True})
    other = calibrate(calibration.specimen, max_steps=30, ess_wanted=50.0, options=options)
    assert observed_readings(other)[1] > 0.0


def test_a_static_reading_is_shown_with_the_level_it_is_nearest_to(calibration: Calibration) -> None:
    places = Readings.at_rest(np.array([104e3, 121e3, 131e3, 260e3]), np.zeros(4))
    frame = _frame("blocked_force", places, np.zeros(4), np.zeros(4, dtype=bool), calibration)
    levels = calibration.specimen.levels_Pa / KPA
    np.testing.assert_allclose(frame["level_kPa"], levels[[0, 0, 1, 2]], atol=1e-3)
    np.testing.assert_allclose(frame["pressure_kPa"], [104.0, 121.0, 131.0, 260.0])


@pytest.fixture(scope="module")
def read_too_far() -> Calibration:
    """A map tells the curve; the free contractions were all read 0.01 too far, one between the levels."""
    pressure, grid = np.repeat([1e5, 1.5e5, 2e5], 30), np.tile(np.linspace(0.0, 0.26, 30), 3)
    force = static_force(pressure / KPA, grid) + NOISE_N * np.random.default_rng(4).standard_normal(90)
    still = np.zeros(90, dtype=np.int64)
    force_map = ForceMap(pressure, grid, force, np.repeat(np.arange(3), 30), still, still > 0)
    true = np.array([free_contraction(level) for level in (100.0, 125.0, 200.0)])
    made = build.specimen(
        {"order": 2, "law": "linear", "friction": "none"},
        levels_kPa=(100.0, 150.0, 200.0),
        force_map=force_map,
        free_contraction=FreeContraction(np.array([1e5, 1.25e5, 2e5]), true + 0.01),
        sensors=Sensors(force_sd_N=NOISE_N),
    )
    return calibrate(made, max_steps=60, ess_wanted=150.0, options=build.PLAIN)


def test_a_free_contraction_is_shown_beside_that_of_the_fit(read_too_far: Calibration) -> None:
    true = np.array([free_contraction(level) for level in (100.0, 125.0, 200.0)])
    rows = observed_readings(read_too_far)[0]
    free = rows[rows["kind"] == "free_contraction"]
    np.testing.assert_allclose(free["contraction"], true + 0.01)
    np.testing.assert_allclose(free["fitted_N"], true, atol=0.004)
    # The band is the curve's, at the reading's own pressure, and does not take the difference up as noise.
    low, high = free["low_N"].to_numpy(), free["high_N"].to_numpy()
    np.testing.assert_allclose((low + high) / 2.0, true, atol=0.002)
    assert (high < true + 0.006).all()


def test_the_page_knows_of_draws_that_end_short_of_a_free_contraction(read_too_far: Calibration) -> None:
    """A quarter of the draws with moduli so large that the bladder holds the muscle back at once."""
    draws = read_too_far.draws
    eta = draws.eta.copy()
    eta[::4] *= 30.0
    bands = read_too_far.bands()
    stiff = replace(read_too_far, draws=replace(draws, eta=eta))
    assert view_of(read_too_far, bands).early_roots == 0.0
    assert view_of(stiff, bands).early_roots == pytest.approx(0.25, abs=0.01)
