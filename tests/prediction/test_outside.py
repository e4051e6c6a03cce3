"""Bands of 90 % at levels left out, where the muscle is none that the package can simulate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.model.blueprint import Options

from .outside import held_out_levels

SPECIMENS = 8
LEAST = 0.80
"""Share of readings, and of true forces, that the bands must hold."""


def shares(folder: Path, count: int, options: Options) -> tuple[float, float]:
    """Mean shares of readings and of true forces inside their bands."""
    levels = [level for seed in range(count) for level in held_out_levels(seed, folder / str(seed), options)]
    assert len(levels) == 3 * count
    readings = float(np.mean([level.readings.mean() for level in levels]))
    return readings, float(np.mean([level.truth.mean() for level in levels]))


def test_the_remainder_covers_another_wall_and_another_friction(tmp_path: Path) -> None:
    readings, truth = shares(tmp_path, SPECIMENS, Options())
    assert readings >= LEAST
    assert truth >= LEAST


def test_without_the_remainder_the_true_forces_are_missed(tmp_path: Path) -> None:
    """The muscles are indeed none that the simulation can be: its own bands hold few of their forces."""
    assert shares(tmp_path, SPECIMENS, Options(remainder=False))[1] < 0.5


@pytest.mark.long
def test_a_thousand_levels_left_out_of_other_muscles(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """334 muscles, 1,002 levels."""
    readings, truth = shares(tmp_path, 334, Options())
    with capsys.disabled():
        print(f"\n1,002 levels: readings {readings:.4f}, true forces {truth:.4f}")
    assert readings >= LEAST
    assert truth >= LEAST
