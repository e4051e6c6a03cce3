"""Recordings of few readings: their noise is neither lost nor taken for a cause."""

from __future__ import annotations

import numpy as np
import pytest
from model.build import loops, specimen, with_force

from criticism.cases import problem_of
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.data.rows import Rows
from mpam_calib.criticism.searching.candidates import candidates
from mpam_calib.criticism.unexplained.bursts import bursts_rms
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import Specimen

NOISE = 0.2
FOUR = (50.0, 100.0, 150.0, 200.0)
DECLARED = {"moduli": "tensile", "E_Pa": (4e4,), "E_rel_sd": 0.1}


def noisy(levels: tuple[float, ...], rows: int, seed: int, sd: float | None, branches: int = 2) -> Specimen:
    """A straight force curve at each level, with white noise."""
    recorded = loops(levels, rows=rows)
    if branches == 1:
        recorded = recorded.without(recorded.branch > 0)
    curve = 50.0 * (1.0 + recorded.level) - 2e3 * recorded.displacement_m + 2.0 * recorded.branch
    force = curve + NOISE * np.random.default_rng(seed).standard_normal(len(curve))
    made = specimen(DECLARED, recorded, sensors=Sensors() if sd is None else Sensors(force_sd_N=sd))
    return with_force(made, force)


@pytest.mark.parametrize("sd", [NOISE, None])
@pytest.mark.parametrize(("levels", "rows"), [(FOUR, 8), (FOUR, 10), (FOUR * 2, 8)])
def test_a_few_short_strokes_do_not_lose_their_noise(
    levels: tuple[float, ...], rows: int, sd: float | None
) -> None:
    """Of eight readings a stroke the median window once left out all with some noise: a quarter was told."""
    levels = tuple(10.0 * j + level for j, level in enumerate(levels))
    found = np.array(
        [problem_of(noisy(levels, rows, seed, sd)).noise_level.total / NOISE for seed in range(40)]
    )
    assert found.min() > 0.5
    assert 0.9 < np.median(found) < 1.1


def test_the_noise_of_one_long_stroke_is_that_of_its_readings() -> None:
    """Not that of the means that they are reduced to."""
    found = [problem_of(noisy((100.0,), 80, seed, None, 1)).noise_level.total / NOISE for seed in range(30)]
    assert 0.9 < np.median(found) < 1.1


@pytest.mark.parametrize("rows", [12, 16, 24])
def test_white_noise_of_short_strokes_has_no_bursts(rows: int) -> None:
    """Means over half a stroke, less the curve that was taken out, are those of its ends alone."""
    found = problem_of(noisy(FOUR, rows, 0, NOISE)).rows
    assert found is not None
    seen = [bursts(found, seed) for seed in range(1500)]
    assert np.mean(np.array(seen) > 0.0) < 0.002


def bursts(rows: Rows, seed: int) -> float:
    noise = np.random.default_rng(seed).standard_normal(len(rows.force))
    return bursts_rms(rows, noise, np.ones(len(noise)))


@pytest.mark.parametrize(("law", "levels", "speaks"), [("constant", 2, True), ("linear", 2, False)])
def test_two_levels_bend_a_constant_law_but_no_line(law: str, levels: int, speaks: bool) -> None:
    recorded = loops(FOUR[:levels], rows=40)
    declared = {**DECLARED, "law": law} if law == "constant" else {"order": 2, "law": law}
    made: Problem = problem_of(with_force(specimen(declared, recorded), 50.0 - 2e3 * recorded.displacement_m))
    assert ("law_shape" in candidates(made).tested) == speaks
