"""A tensile test of many rows: grouped, it says of noise and moduli what its rows do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build
from numpy.typing import NDArray
from scipy import fft, signal, stats

from mpam_calib.calibration import calibrate
from mpam_calib.model.blueprint import draw_blueprint
from mpam_calib.model.model import build_model
from mpam_calib.model.tensile import NOISE as NOISE_NAME
from mpam_calib.posterior.density.tensile_piece import tensile_piece
from mpam_calib.posterior.draws import reported
from mpam_calib.posterior.likelihood.likeness import LONGEST, SHARES, TIMES, hidden_time
from mpam_calib.posterior.likelihood.tensile_points import TENSILE_POINTS, gather_tensile
from mpam_calib.posterior.tested_moduli import moduli_of_test
from mpam_calib.specimen.recording import Specimen, Tensile

Array = NDArray[np.float64]

MODULI = np.array([4.0e4, 2.6e4])
SIMULATION = {"moduli": "tensile", "order": 2, "law": "constant"}
NOISE = 300.0
"""Pa."""


def pieces(rows: int, apart: float) -> Tensile:
    """Two test pieces of ``rows`` readings each, one stiffer by a share ``apart``, one softer."""
    rng = np.random.default_rng(1)
    strain = np.linspace(0.01, 1.5, rows)
    stress = strain[:, None] ** np.arange(1, 3) @ MODULI
    each = [(1.0 + sign * apart) * stress + NOISE * rng.standard_normal(rows) for sign in (1.0, -1.0)]
    return Tensile(np.tile(strain, 2), np.concatenate(each))


def rubber(test: Tensile) -> Specimen:
    return replace(build.specimen(SIMULATION, levels_kPa=()), tensile=test, geometry=None, braid=None)


def first_sd(test: Tensile) -> float:
    found = moduli_of_test(rubber(test))
    assert found is not None
    return float(np.sqrt(found.covariance[0][0]))


def test_few_rows_are_taken_as_they_are() -> None:
    test = pieces(TENSILE_POINTS // 2, 0.0)
    points = gather_tensile(test, 0.0, 2.0)
    order = np.argsort(test.strain, kind="stable")
    assert np.array_equal(points.stress, test.stress_Pa[order]) and np.all(points.count == 1.0)
    assert (points.within, points.rows) == (0.0, TENSILE_POINTS)


@pytest.mark.parametrize("rows", [201, 333, 1000])
def test_points_keep_the_sum_of_squares_about_a_straight_law(rows: int) -> None:
    test = pieces(rows, 0.08)
    points = gather_tensile(test, 0.0, 2.0)
    share = points.rows / (2 * rows)
    assert points.count.sum() == pytest.approx(points.rows) and len(points.strain) <= TENSILE_POINTS
    for start, slope in ((0.0, 5e4), (2e3, 7e4)):
        of_rows = np.sum((test.stress_Pa - start - slope * test.strain) ** 2)
        of_points = points.count @ (points.stress - start - slope * points.strain) ** 2 + points.within
        assert of_points == pytest.approx(share * of_rows, rel=1e-9)


def test_points_have_the_density_of_all_rows() -> None:
    """Of a thousand rows that are worth a thousand, under a law without stress: row by row."""
    strain = np.linspace(0.01, 1.5, 1000)
    stress = 4e4 * strain + np.random.default_rng(0).standard_normal(1000)
    test = Tensile(strain, stress)
    model = build_model(draw_blueprint(rubber(test), build.PLAIN))
    points = gather_tensile(test, 0.0, 2.0)
    assert (len(points.strain), points.rows) == (TENSILE_POINTS, 1000)
    noise = np.array([[0.5], [1e4]])
    found = tensile_piece(model, {NOISE_NAME: noise}, points).constant
    rows = stats.norm.logpdf(stress, 0.0, noise).sum(axis=1)
    assert -0.5 * found == pytest.approx(rows, rel=1e-9)


def test_noise_and_bands_do_not_depend_on_how_finely_two_pieces_are_read() -> None:
    noise = []
    for rows in (100, 2000):
        test = pieces(rows, 0.08)
        found = calibrate(rubber(test))
        listed = {item.name: item.draws for item in reported(found.model, found.draws)}
        noise.append(listed["tensile_noise_sd_Pa"].mean())
        bands = found.bands()
        bands = bands[bands["quantity"] == "stress_Pa_observed"]
        low, high = (np.interp(test.strain, bands["contraction"], bands[q]) for q in ("q05", "q95"))
        assert np.mean((test.stress_Pa >= low) & (test.stress_Pa <= high)) > 0.85
    assert noise[1] == pytest.approx(noise[0], rel=0.2)


def test_more_rows_of_the_same_pieces_tell_no_more_of_the_moduli() -> None:
    few = first_sd(pieces(200, 0.08))
    for rows in (400, 2000):
        assert first_sd(pieces(rows, 0.08)) == pytest.approx(few, rel=0.1)


def test_rows_that_differ_by_noise_alone_all_count() -> None:
    for rows in (400, 2000):
        assert gather_tensile(pieces(rows, 0.0), 0.0, 2.0).rows > 0.8 * 2 * rows
    assert first_sd(pieces(2000, 0.0)) < 0.7 * first_sd(pieces(200, 0.0))


def slow_noise(rows: int, time: float, seed: int) -> Array:
    """Noise of size 1, correlated over ``time`` rows."""
    rng = np.random.default_rng(seed)
    fresh, a = rng.standard_normal(rows), np.exp(-1.0 / time)
    start = np.full(1, a * rng.standard_normal())
    return np.asarray(signal.lfilter([np.sqrt(1.0 - a**2)], [1.0, -a], fresh, zi=start)[0])


@pytest.mark.parametrize(("rows", "time"), [(1000, 3.0), (1000, 10.0), (2000, 20.0)])
def test_slow_noise_counts_as_the_few_readings_that_it_is(rows: int, time: float) -> None:
    """Also the slowest part of it, which a smooth curve through the rows takes along."""
    strain = np.linspace(0.01, 1.5, rows)
    stress = strain[:, None] ** np.arange(1, 3) @ MODULI
    tests = [Tensile(strain, stress + NOISE * slow_noise(rows, time, seed)) for seed in range(20)]
    worth = np.median([gather_tensile(test, 0.0, 2.0).rows for test in tests])
    assert worth == pytest.approx(rows / (2.0 * time), rel=0.3)


def test_how_long_noise_lasts_is_averaged_over_all_that_it_may_be() -> None:
    """By brute force: the power of each half-wave, for every time, share and size of the noise.

    Flat in the logarithm of the size; no correlation is as probable as all of it. A curve of the third degree
    has taken the longest half-waves.
    """
    n, degree = 60, 3
    rng = np.random.default_rng(3)
    left = signal.lfilter([1.0], [1.0, -0.7], rng.standard_normal(n + 50))[50:]
    wave = np.arange(degree + 1, n)
    power = fft.dct(left, norm="ortho")[wave] ** 2
    log_sizes = np.linspace(-6.0, 6.0, 301)[:, None]
    weight, inverse = [], []
    for a in np.exp(-1.0 / np.geomspace(0.5, LONGEST * n, TIMES)):
        lasts = (1.0 - a**2) / np.abs(1.0 - a * np.exp(1j * np.pi * wave / n)) ** 2
        for share in np.sqrt(np.linspace(0.0, 1.0, SHARES)):
            spectrum = 1.0 - share + share * lasts
            each = power / spectrum * np.exp(-log_sizes) + np.log(spectrum) + log_sizes
            density = np.exp(-0.5 * np.sum(each, axis=1))
            weight.append(np.sum(density) / (TIMES if share == 0.0 else TIMES * (SHARES - 1)))
            inverse.append(1.0 / (1.0 - share + share * (1.0 + a) / (1.0 - a)))
    expected = np.sum(weight) / np.sum(np.multiply(weight, inverse))
    assert expected > 2.0
    assert hidden_time(left, degree) == pytest.approx(expected, rel=1e-6)


def test_bands_hold_the_law_under_slow_noise() -> None:
    inside = []
    for seed in range(4):
        strain = np.linspace(0.01, 1.5, 1000)
        stress = strain[:, None] ** np.arange(1, 3) @ MODULI + 3.0 * NOISE * slow_noise(1000, 10.0, seed)
        bands = calibrate(rubber(Tensile(strain, stress)), seed=seed).bands()
        bands = bands[bands["quantity"] == "stress_Pa"]
        true = bands["contraction"].to_numpy()[:, None] ** np.arange(1, 3) @ MODULI
        inside.append(np.mean((true >= bands["q05"]) & (true <= bands["q95"])))
    assert np.mean(inside) > 0.75


@pytest.mark.parametrize(("count", "rows"), [(3, 40), (5, 300)])
def test_bands_hold_the_law_of_pieces_that_differ(count: int, rows: int) -> None:
    """Each piece is stiffer or softer by 6 % or so: readings of one piece are no independent tests of it."""
    strain = np.linspace(0.02, 1.5, rows)
    stress = strain[:, None] ** np.arange(1, 3) @ MODULI
    at = np.array([0.5, 1.0, 1.4])[:, None] ** np.arange(1, 3)
    inside = []
    for seed in range(15):
        rng = np.random.default_rng(seed)
        each = [
            (1.0 + 0.06 * rng.standard_normal()) * stress + NOISE * rng.standard_normal(rows)
            for _ in range(count)
        ]
        found = moduli_of_test(rubber(Tensile(np.tile(strain, count), np.concatenate(each))))
        assert found is not None
        sd = np.sqrt(np.einsum("ij,jk,ik->i", at, np.array(found.covariance), at))
        inside.append(np.abs(at @ (np.array(found.mean) - MODULI)) < 1.645 * sd)
    assert np.mean(inside) > 0.75
