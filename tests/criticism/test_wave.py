"""A wave in time too slow for a stroke's spectrum: found with its size, silent on noise and on structure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import signal

from criticism.found import search
from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.unexplained.wave import wave_rms
from mpam_calib.criticism.verdict import judge

from .cases import problem_of, specimen_of
from .test_hum import FILTERS, noise_of
from .test_structure import NULLS, left

Array = NDArray[np.float64]


def stroke_s(rows: Rows) -> float:
    """Median duration of a stroke, s."""
    return float(np.median([np.ptp(rows.readings.time[rows.stroke == s]) for s in np.unique(rows.stroke)]))


def wave(rows: Rows, each: float) -> Array:
    """A sine of unit root mean square with so many periods in a stroke."""
    return np.asarray(np.sqrt(2.0) * np.sin(2.0 * np.pi * each * rows.readings.time / stroke_s(rows) + 0.4))


@pytest.mark.parametrize("filtered", [*FILTERS, "as slow as strokes"])
def test_noise_makes_no_waves(rows: Rows, filtered: str) -> None:
    for seed in range(20):
        if filtered in FILTERS:
            noise = noise_of(filtered, rows, seed)
        else:
            white = np.random.default_rng(seed).standard_normal(len(rows.force))
            noise = signal.lfilter(
                [1.0], [1.0, -np.exp(-2.0 * np.unique(rows.stroke).size / len(white))], white
            )
        assert wave_rms(rows, noise) == 0.0
        assert wave_rms(rows, noise * (1.0 + rows.stroke % 3)) == 0.0


@pytest.mark.parametrize("filtered", ["resonant", "second order", "second order, slow"])
def test_slow_noise_in_any_number_of_strokes_is_no_wave(rows: Rows, filtered: str) -> None:
    """In few of them a single frequency may hold much of it by chance."""
    for levels in range(1, int(rows.readings.level.max()) + 2):
        few = np.flatnonzero(rows.readings.level < levels)
        short = Rows(rows.readings.take(few), rows.force[few], rows.stroke[few], rows.rest[few])
        for seed in range(60):
            assert wave_rms(short, noise_of(filtered, short, seed)) == 0.0


@pytest.mark.parametrize("name", NULLS)
def test_what_a_rig_without_a_wave_records_has_none(name: str) -> None:
    problem = problem_of(specimen_of(name))
    assert problem.rows is not None
    assert wave_rms(problem.rows, left(problem, fit(problem, frozenset(), 0))) == 0.0


@pytest.mark.parametrize("each", [2.1, 3.4])
def test_a_wave_is_found_with_its_size(rows: Rows, each: float) -> None:
    """Twice and four times as large as the noise; two fifths of it do not matter, however sure."""
    for size in (2.0, 4.0):
        found = wave_rms(rows, noise_of("white", rows, 7) + size * wave(rows, each))
        assert found == pytest.approx(size, rel=0.2)
    assert wave_rms(rows, noise_of("white", rows, 7) + 0.4 * wave(rows, each)) == 0.0


@pytest.mark.parametrize("pause", [3.0, 1e4, 1e9])
def test_a_pause_makes_no_waves_and_a_short_one_hides_none(rows: Rows, pause: float) -> None:
    """So many strokes' times between the two halves of a test; the wave keeps time all along."""
    later = rows.stroke > np.median(rows.stroke)
    time = rows.readings.time + pause * stroke_s(rows) * later
    paused = replace(rows, readings=replace(rows.readings, time=time))
    noise = noise_of("white", rows, 5)
    assert wave_rms(paused, noise) == 0.0
    if pause < 10.0:
        assert wave_rms(paused, noise + 4.0 * wave(paused, 3.4)) == pytest.approx(4.0, rel=0.2)


def test_what_differs_from_cycle_to_cycle_is_no_wave(rows: Rows) -> None:
    """A bend along the way in first cycles alone, or less with each, many times the noise."""
    place = rows.readings.displacement / rows.readings.displacement.max()
    noise = noise_of("white", rows, 3)
    for fades in (rows.readings.cycle == 1.0, 1.0 / rows.readings.cycle):
        for bend in (place**2, np.sin(np.pi * place), np.exp(-10.0 * place)):
            assert wave_rms(rows, noise + 10.0 * fades * bend) == 0.0


@pytest.mark.parametrize(
    "name", ["develop-null-001", pytest.param("develop-null-004", marks=pytest.mark.long)]
)
def test_a_regulator_that_hunts_is_unexplained(name: str) -> None:
    """Four times the noise, in proportion to the pressure, two periods in a stroke."""
    specimen = specimen_of(name)
    problem = problem_of(specimen)
    assert specimen.loops is not None
    assert problem.rows is not None
    period = stroke_s(problem.rows) / 2.1
    swing = np.sin(2.0 * np.pi * specimen.loops.time_s / period) * specimen.loops.pressure_Pa
    force = specimen.loops.force_N + 4.0 * problem.noise_level.total * swing / np.std(swing)
    hunting = replace(specimen, loops=replace(specimen.loops, force_N=force))
    verdict = judge(search(problem_of(hunting), ("dead_band", "creep", "stress_softening")))
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset())
    assert verdict.faults.hum > problem.noise_level.total
