"""Bands of 90 % hold what they should at levels that were left out, when the model is true."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.model.blueprint import Options

from .coverage import held_out_levels

WITHOUT = Options(remainder=False)
SPECIMENS = 10
LEVEL_SD = 0.045
"""Scatter of one level's share of readings inside its band: about 70 correlated rows, one posterior."""


@pytest.fixture(scope="module")
def few():
    return [level for seed in range(SPECIMENS) for level in held_out_levels(seed, WITHOUT)]


def test_readings_at_levels_left_out(few):
    """30 levels: 0.90 to within 4 sds of their mean, 0.033."""
    share = np.mean([level.readings.mean() for level in few])
    assert abs(share - 0.90) < 4.0 * LEVEL_SD / np.sqrt(len(few))


def test_true_forces_at_levels_left_out(few):
    """Noise-free bands at one place of each specimen: binomial, 10 places, at most 4 outside (p < 0.002)."""
    middle = [few[3 * i + i % 3].truth for i in range(SPECIMENS)]
    held = sum(bool(inside[len(inside) // 2]) for inside in middle)
    assert held >= 6


def test_bands_narrowed_by_a_fifth_do_not_pass():
    """They hold 81 % of the readings."""
    narrowed = [level for seed in range(SPECIMENS) for level in held_out_levels(seed, WITHOUT, narrow=0.8)]
    share = np.mean([level.readings.mean() for level in narrowed])
    assert share < 0.90 - 4.0 * LEVEL_SD / np.sqrt(len(narrowed))


@pytest.mark.long
@pytest.mark.parametrize("options", [WITHOUT, Options()], ids=["without remainder", "with remainder"])
def test_a_thousand_levels_left_out(options, capsys):
    """334 specimens, 1,002 levels: 0.88 to 0.92 of the readings."""
    levels = [level for seed in range(334) for level in held_out_levels(seed, options)]
    readings = float(np.mean([level.readings.mean() for level in levels]))
    truth = float(np.mean([level.truth.mean() for level in levels]))
    with capsys.disabled():
        print(f"\n{len(levels)} levels: readings {readings:.4f}, true forces {truth:.4f}")
    assert 0.88 <= readings <= 0.92
    assert truth >= 0.85


@pytest.mark.long
def test_levels_left_out_with_emcee():
    """Twelve specimens sampled as calibrate samples them: the same share as by importance sampling."""
    levels = [level for seed in range(12) for level in held_out_levels(seed, WITHOUT, exact=True)]
    share = np.mean([level.readings.mean() for level in levels])
    assert abs(share - 0.90) < 4.0 * LEVEL_SD / np.sqrt(len(levels))
