"""Noise alone is no pull: the pressure from which on a muscle surely pulls lies above its dead-band."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mpam_calib.model.pull import pulls_at
from mpam_calib.specimen.declaration import Sensors
from mpam_calib.specimen.recording import BlockedForce, ForceMap, Specimen

from . import build

DEAD_BAND, TOP = 25e3, 200e3


def pull(pressure: np.ndarray, contraction: np.ndarray) -> np.ndarray:
    """Force (N) that is 100 N at the top and ends, bending, where the contraction reaches 0.35."""
    share = np.maximum(pressure - DEAD_BAND, 0.0) / (TOP - DEAD_BAND)
    return 100.0 * share * (1.0 - contraction / 0.35) * (1.0 - 0.8 * contraction)


def loops(seed: int, noise: float) -> Specimen:
    recorded = build.loops((20.0, 65.0, 110.0, 155.0, 200.0), 10.0, 60, cycles=2)
    true = pull(recorded.pressure_Pa, recorded.displacement_m / 0.05)
    force = true + noise * np.random.default_rng(seed).standard_normal(len(true))
    return build.with_force(build.specimen(None, recorded, sensors=Sensors()), force)


def blocked(seed: int, noise: float, repeats: int = 5) -> Specimen:
    pressure = np.repeat(np.linspace(2e3, TOP, 41), repeats)
    force = pull(pressure, np.zeros(len(pressure)))
    force = force + noise * np.random.default_rng(seed).standard_normal(len(pressure))
    readings = BlockedForce(pressure, force, np.zeros(len(force), dtype=bool))
    return build.specimen(
        sensors=Sensors(), levels_kPa=tuple((pressure[::repeats] / 1e3).tolist()), blocked_force=readings
    )


def static_map(seed: int, noise: float) -> Specimen:
    """Ten levels at seven contractions, each curve once."""
    levels = np.linspace(10e3, TOP, 10)
    level, contraction = (
        a.ravel() for a in np.meshgrid(np.arange(10), np.linspace(0.0, 0.3, 7), indexing="ij")
    )
    force = pull(levels[level], contraction)
    force = force + noise * np.random.default_rng(seed).standard_normal(len(level))
    none = np.zeros(len(level), dtype=np.int64)
    grid = ForceMap(levels[level], contraction, force, level, none, none > 0)
    return build.specimen(sensors=Sensors(), levels_kPa=tuple((levels / 1e3).tolist()), force_map=grid)


@pytest.mark.parametrize("made", [loops, blocked, static_map])
@pytest.mark.parametrize("noise", [0.5, 2.0, 3.0])
def test_noise_is_no_pull(made, noise: float) -> None:
    found = [pulls_at(made(seed, noise)) for seed in range(12)]
    assert min(found) > DEAD_BAND
    # Nor is the bound so loose that it tells nothing.
    assert max(found) < 0.5 * TOP


def test_blocked_forces_read_once_each() -> None:
    assert min(pulls_at(blocked(seed, 2.0, repeats=1)) for seed in range(12)) > DEAD_BAND


def test_curves_that_bend_are_not_noise() -> None:
    """Without any noise a map pulls from its first level above the dead-band on."""
    assert pulls_at(static_map(0, 0.0)) == pytest.approx(10e3 + 190e3 / 9)


def test_a_declared_noise_is_believed() -> None:
    made = loops(0, 2.0)
    declared = replace(made, sensors=Sensors(force_sd_N=0.1))
    assert pulls_at(declared) == pytest.approx(20e3)
    assert pulls_at(made) == pytest.approx(65e3)
