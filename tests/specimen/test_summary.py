"""What ``check`` lists of a recording."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mpam_calib.specimen import read
from mpam_calib.specimen.summary import force_noise, reading_noise, summarise_loops

from .folders import DECLARATION, HEADER, loops, make

RATE, LEVEL, TOP_MM, STROKES = 10.0, 100.0, 10.0, 8


@pytest.mark.parametrize("phase", [0.0, 0.3, 0.7])
@pytest.mark.parametrize("rows", [4, 5, 6, 8, 40])
def test_a_speed_is_listed_however_few_readings_a_stroke_has(tmp_path: Path, rows: int, phase: float) -> None:
    """A triangle that turns at a reading, or a share of the way between two of them before it."""
    t = (np.arange(rows * STROKES) + phase) / RATE
    x = TOP_MM * np.abs((t * RATE / rows + 1.0) % 2.0 - 1.0)
    force = 30.0 - x + np.where(t * RATE / rows % 2.0 < 1.0, -0.5, 0.5)
    text = "\n".join(f"{a:.3f},{LEVEL},{b:.5f},{c:.5f}" for a, b, c in zip(t, x, force, strict=True))
    declaration = DECLARATION.replace('"linear"', '"constant"')
    specimen = read(make(tmp_path, declaration, loops=f"{HEADER}\n{text}\n"))
    assert specimen.loops is not None and specimen.geometry is not None
    (level,) = summarise_loops(specimen.loops, specimen.levels_Pa, specimen.geometry.L0).levels
    assert level.speeds_mm_per_min == pytest.approx((TOP_MM * RATE / rows * 60.0,), rel=0.05)


def test_the_noise_of_one_reading_is_at_least_what_its_display_makes(tmp_path: Path) -> None:
    recorded = loops()
    noise = 0.2 * np.random.default_rng(1).standard_normal(len(recorded.force))
    found = read(make(tmp_path, loops=replace(recorded, force=recorded.force + noise).text())).loops
    assert found is not None
    assert force_noise(found) == reading_noise(found) == pytest.approx(0.2, rel=0.2)
    coarse = replace(found, force_N=np.round(found.force_N / 20.0) * 20.0)
    assert reading_noise(coarse) == pytest.approx(20.0 / np.sqrt(12.0))


def test_no_speeds_are_listed_of_readings_at_held_length(tmp_path: Path) -> None:
    """What the encoder rustles by while the muscle is filled is no speed."""
    recorded = loops((100.0, 200.0), encoder_sd=0.003)
    p = np.tile(np.concatenate([np.linspace(0.0, 300.0, 100), np.linspace(300.0, 0.0, 100)]), 2)
    words = np.repeat(["pressurising", "depressurising"] * 2, 100)
    x = np.repeat([0.0, 5.0], 200) + 0.003 * np.random.default_rng(2).standard_normal(400)
    t = recorded.time[-1] + 0.1 * np.arange(1, 401)
    rows = [
        f"{row},{'loading' if way == 1 else 'unloading'}"
        for row, way in zip(recorded.text().splitlines()[1:], recorded.branch, strict=True)
    ]
    rows += [f"{a:.3f},{b:.4f},{c:.5f},{0.3 * b:.4f},{d}" for a, b, c, d in zip(t, p, x, words, strict=True)]
    specimen = read(make(tmp_path, loops="\n".join([f"{HEADER},branch", *rows]) + "\n"))
    assert specimen.loops is not None and specimen.geometry is not None
    assert {2, -2} < set(specimen.loops.branch.tolist())
    for level in summarise_loops(specimen.loops, specimen.levels_Pa, specimen.geometry.L0).levels:
        assert all(speed == pytest.approx(48.0, rel=0.05) for speed in level.speeds_mm_per_min)
    alone = make(tmp_path / "held", loops="\n".join([f"{HEADER},branch", *rows[len(recorded.time) :]]) + "\n")
    held = read(alone)
    assert held.loops is not None and held.geometry is not None
    for level in summarise_loops(held.loops, held.levels_Pa, held.geometry.L0).levels:
        assert not level.speeds_mm_per_min
