"""A hum in the readings: found with its size at any pace, silent on noise however correlated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from criticism.found import search
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.unexplained.faults import faults_of
from mpam_calib.criticism.unexplained.hum import hum_rms
from mpam_calib.criticism.verdict import judge

from .cases import problem_of, specimen_of
from .test_structure import NULLS, left

Array = NDArray[np.float64]

FILTERS = {
    "white": ([1.0], [1.0]),
    "correlated for four readings": ([1.0], [1.0, -np.exp(-0.25)]),
    "mean of three": ([1.0, 1.0, 1.0], [1.0]),
    "resonant": ([1.0], [1.0, -1.0, 0.6]),
    "second order": signal.butter(2, 0.15),
    "second order, slow": signal.butter(2, 0.06),
}


def noise_of(filtered: str, rows: Rows, seed: int) -> Array:
    """Noise of unit size."""
    white = np.random.default_rng(seed).standard_normal(len(rows.force) + 100)
    noise = signal.lfilter(*FILTERS[filtered], white)[100:]
    return np.asarray(noise / np.std(noise))


@pytest.mark.parametrize("filtered", FILTERS)
def test_noise_does_not_hum(rows: Rows, filtered: str) -> None:
    """Nor does noise whose size differs from one stroke to the next."""
    for seed in range(20):
        noise = noise_of(filtered, rows, seed)
        assert hum_rms(rows, noise) == 0.0
        assert hum_rms(rows, noise * (1.0 + rows.stroke % 3)) == 0.0


@pytest.mark.parametrize("name", NULLS)
def test_what_a_rig_without_a_hum_records_does_not_hum(name: str) -> None:
    problem = problem_of(specimen_of(name))
    assert problem.rows is not None
    assert hum_rms(problem.rows, left(problem, fit(problem, frozenset(), 0))) == 0.0


def hum(rows: Rows, readings: float) -> Array:
    """A sine of unit root mean square with a period of so many time steps of the fastest strokes."""
    step = np.quantile(np.diff(rows.readings.time), 0.05)
    return np.asarray(np.sqrt(2.0) * np.sin(2.0 * np.pi * rows.readings.time / (readings * step) + 1.0))


@pytest.mark.parametrize("filtered", ["white", "correlated for four readings"])
@pytest.mark.parametrize("readings", [2.3, 3.1, 4.6])
def test_a_hum_is_found_with_its_size(rows: Rows, filtered: str, readings: float) -> None:
    """As large as the noise and twice as large; a fifth of it does not matter."""
    for size in (1.0, 2.0):
        found = hum_rms(rows, noise_of(filtered, rows, 7) + size * hum(rows, readings))
        assert found == pytest.approx(size, rel=0.25)
    assert hum_rms(rows, noise_of(filtered, rows, 7) + 0.2 * hum(rows, readings)) == 0.0


def test_strokes_with_readings_missing_are_left_out(rows: Rows) -> None:
    """A line in a spectrum supposes even steps; what is left is enough, and nothing at all is no error."""
    some = np.random.default_rng(2).random(len(rows.force)) > 0.5
    gaps = Rows(rows.readings.take(some), rows.force[some], rows.stroke[some], rows.rest[some])
    assert hum_rms(gaps, noise_of("white", gaps, 1)) == 0.0
    none = np.zeros(len(rows.force), dtype=bool)
    nothing = Rows(rows.readings.take(none), rows.force[none], rows.stroke[none], rows.rest[none])
    assert hum_rms(nothing, np.zeros(0)) == 0.0


def humming(size: float) -> Problem:
    """A muscle without a cause on a rig that hums, by so many times its noise."""
    specimen = specimen_of("develop-null-001")
    loops = specimen.loops
    assert loops is not None
    rows = problem_of(specimen).rows
    assert rows is not None
    noise = problem_of(specimen).noise_level.total
    step = np.quantile(np.diff(loops.time_s), 0.05)
    force = loops.force_N + size * noise * np.sqrt(2.0) * np.sin(2.0 * np.pi * loops.time_s / (2.3 * step))
    return problem_of(replace(specimen, loops=replace(loops, force_N=force)))


def test_the_verdict_on_a_rig_that_hums() -> None:
    problem = humming(2.0)
    verdict = judge(search(problem, ("dead_band", "creep"), workers=1))
    assert verdict.word == "unexplained"
    assert verdict.standing == frozenset()
    assert verdict.faults.hum > 0.0


def test_a_hum_far_below_the_noise_of_a_reading_is_none() -> None:
    """Where there is next to no noise its prior says how much there may be, and rounding is what is left."""
    problem = humming(2.0)
    fitted = fit(problem, frozenset(), 0)
    loud = replace(problem.noise_level, white=200.0 * problem.noise_level.total)
    assert faults_of(problem, fitted).hum > 0.0
    assert faults_of(replace(problem, noise_level=loud), fitted).hum == 0.0
