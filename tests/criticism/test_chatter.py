"""Chatter: scatter one way is found with its size; no noise that knows no way, however uneven, is any."""

from __future__ import annotations

from dataclasses import replace
from math import comb

import numpy as np
import pytest
from numpy.typing import NDArray

from criticism.found import search
from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.fitting.fit import fit
from mpam_calib.criticism.unexplained.chatter import FEWEST, SURE, chatter_rms
from mpam_calib.criticism.verdict import judge

from .cases import problem_of, specimen_of
from .test_hum import FILTERS, noise_of
from .test_structure import NULLS, left

Array = NDArray[np.float64]


def test_so_few_strokes_as_are_compared_can_be_that_sure() -> None:
    """Of strokes parted without an exception: one order in so many (Mann and Whitney 1947)."""
    assert 1.0 / comb(2 * FEWEST, FEWEST) < SURE < 1.0 / comb(2 * FEWEST - 2, FEWEST - 1)


def even(rows: Rows) -> Array:
    return np.ones(len(rows.force))


@pytest.mark.parametrize("filtered", FILTERS)
def test_noise_knows_no_way(rows: Rows, filtered: str) -> None:
    """Nor does noise whose size differs between strokes, levels and paces, nor one with heavy tails."""
    pace = np.median(np.diff(rows.readings.time))
    slow = np.diff(rows.readings.time, append=rows.readings.time[-1] + pace) > 1.5 * pace
    for seed in range(10):
        noise = noise_of(filtered, rows, seed)
        for uneven in (even(rows), 1.0 + rows.stroke % 3, 1.0 + rows.readings.level, 1.0 + 4.0 * slow):
            assert chatter_rms(rows, noise * uneven, even(rows)) == 0.0
        tails = np.random.default_rng(seed).standard_t(3.0, len(noise))
        assert chatter_rms(rows, tails, even(rows)) == 0.0


def test_noise_that_grows_with_a_force_that_friction_parts_knows_none(rows: Rows) -> None:
    grows = 1.0 + np.where(rows.readings.sign > 0.0, 4.0, 0.0)
    noise = noise_of("white", rows, 3) * grows
    assert chatter_rms(rows, noise, grows) == 0.0
    assert chatter_rms(rows, noise, even(rows)) > 0.0


@pytest.mark.parametrize("name", NULLS)
def test_what_a_rig_records_does_not_chatter(name: str) -> None:
    problem = problem_of(specimen_of(name))
    assert problem.rows is not None
    residual = left(problem, fit(problem, frozenset(), 0))
    assert chatter_rms(problem.rows, residual, even(problem.rows)) == 0.0


def test_what_a_fit_leaves_next_to_the_turns_of_one_way_is_no_chatter(rows: Rows) -> None:
    x, starts = rows.readings.displacement, np.flatnonzero(np.diff(rows.stroke, prepend=-1))
    travel = np.abs(x - np.repeat(x[starts], np.diff([*starts, len(x)]))) / np.ptp(x)
    knee = 20.0 * np.exp(-travel / 0.03) * (rows.readings.sign > 0.0)
    assert chatter_rms(rows, noise_of("white", rows, 5) + knee, even(rows)) == 0.0


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_scatter_on_one_way_is_found_with_its_size(rows: Rows, way: float) -> None:
    """Of three times the noise; where it is as large, the ratio of 1.4 does not matter."""
    there = rows.readings.sign == way
    noise, more = noise_of("white", rows, 7), noise_of("mean of three", rows, 8)
    assert chatter_rms(rows, noise + 3.0 * more * there, even(rows)) == pytest.approx(3.0, rel=0.25)
    assert chatter_rms(rows, noise + more * there, even(rows)) == 0.0


def test_chatter_is_in_newtons_whatever_the_noise_is_measured_in(rows: Rows) -> None:
    """Strokes compare by what the noise of a reading is there; what one way has more is of the mean one."""
    chatters = noise_of("white", rows, 7) * np.where(rows.readings.sign > 0.0, 4.0, 1.0)
    plain = chatter_rms(rows, chatters, even(rows))
    assert plain == pytest.approx(np.sqrt(15.0), rel=0.1)
    assert chatter_rms(rows, chatters, 0.2 * even(rows)) == pytest.approx(plain)
    grows = 1.0 + rows.readings.level
    found = chatter_rms(rows, chatters * grows, grows)
    assert found == pytest.approx(plain * np.mean(grows), rel=0.1)


def test_nothing_at_all_is_no_error(rows: Rows) -> None:
    none = np.zeros(len(rows.force), dtype=bool)
    nothing = Rows(rows.readings.take(none), rows.force[none], rows.stroke[none], rows.rest[none])
    assert chatter_rms(nothing, np.zeros(0), np.ones(0)) == 0.0


def test_the_verdict_on_strands_that_stick_and_slip_one_way() -> None:
    """A sawtooth along the way, another in every stroke, of six times the noise from top to bottom."""
    specimen = specimen_of("develop-null-001")
    loops, noise = specimen.loops, problem_of(specimen).noise_level.total
    assert loops is not None
    phase = np.random.default_rng(4).random(int(loops.stroke.max()) + 1)[loops.stroke]
    along = loops.displacement_m / np.ptp(loops.displacement_m)
    sawtooth = 6.0 * noise * ((along / 0.09 + phase) % 1.0 - 0.5) * (loops.branch > 0)
    problem = problem_of(replace(specimen, loops=replace(loops, force_N=loops.force_N + sawtooth)))
    verdict = judge(search(problem, ("dead_band", "creep"), workers=1))
    assert (verdict.word, verdict.standing) == ("unexplained", frozenset())
    assert verdict.faults.chatter == pytest.approx(6.0 * noise / np.sqrt(12.0), rel=0.4)
