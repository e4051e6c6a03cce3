"""The blocked force where the simulation is far off: at full length, the edge of all readings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from .far_off import AtFullLength, blocked_forces

MUSCLES = 12


@pytest.fixture(scope="module")
def found(tmp_path_factory: pytest.TempPathFactory) -> list[AtFullLength]:
    folder = tmp_path_factory.mktemp("muscles")
    return [blocked_forces(seed, folder / str(seed)) for seed in range(MUSCLES)]


def test_bands_hold_the_true_blocked_forces(found: list[AtFullLength]) -> None:
    assert np.mean([each.inside.mean() for each in found]) >= 0.8


def test_the_error_lies_on_neither_side(found: list[AtFullLength]) -> None:
    """A remainder that were level at full length would say too little at one end of the pressures."""
    error = np.array([(each.draws.mean(axis=0) - each.true) / each.true[-1] for each in found])
    assert np.abs(error).mean() < 0.0015
    slope = error[:, -1] - error[:, 0]
    assert np.abs(slope.mean()) < 3.0 * slope.std() / np.sqrt(MUSCLES)


def test_without_a_remainder_the_blocked_forces_are_missed(tmp_path: Path) -> None:
    """By several per cent: there is something to make up for."""
    found = [blocked_forces(seed, tmp_path / str(seed), remainder=False) for seed in range(4)]
    assert np.mean([each.inside.mean() for each in found]) < 0.2
    error = [np.abs(each.draws.mean(axis=0) - each.true).max() / each.true[-1] for each in found]
    assert min(error) > 0.03


@pytest.mark.long
def test_two_hundred_muscles(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    each = [blocked_forces(seed, tmp_path / str(seed)) for seed in range(200)]
    share = float(np.mean([one.inside.mean() for one in each]))
    with capsys.disabled():
        print(f"\n{sum(len(one.true) for one in each)} blocked forces: {share:.4f} in their 90 % bands")
    assert share >= 0.85
