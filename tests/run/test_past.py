"""What readings owe to the test's past, by a calibration whose muscle creeps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from model import build

from mpam_calib.calibration import Calibration, calibrate
from mpam_calib.report.past import past
from mpam_calib.run.view import view_of
from mpam_calib.units import KPA

from .small import K_F, L0, NOISE_N, static_force

PER_DECADE = 0.04


@pytest.fixture(scope="module")
def creeping() -> Calibration:
    """Loops of a muscle whose force falls by PER_DECADE of it in ten times the time at a level."""
    rng = np.random.default_rng(3)
    loops = build.loops(rows=32)
    force = static_force(loops.pressure_Pa / KPA, 1e3 * loops.displacement_m / L0)
    force = force + K_F * np.abs(force) * loops.branch
    since = loops.time_s - np.array([loops.time_s[loops.level == k].min() for k in loops.level])
    force = force * (1.0 - PER_DECADE * np.log10(1.0 + since)) + NOISE_N * rng.standard_normal(len(force))
    made = build.with_force(build.specimen(None, loops), force)
    simulation = made.simulation.model_copy(update={"effects": ("creep",)})
    return calibrate(
        replace(made, simulation=simulation), max_steps=60, ess_wanted=150.0, options=build.PLAIN
    )


def test_readings_of_a_muscle_that_creeps_lie_below_its_bands(creeping: Calibration) -> None:
    bands = creeping.bands()
    view = view_of(creeping, bands)
    rows = view.readings("loops")
    bins = creeping.target.data.bins
    assert bins is not None
    gain = 1.0 - PER_DECADE * np.log10(1.0 + bins.middle().time_at_level)
    off = rows["force_N"].to_numpy() * (1.0 - 1.0 / gain)
    assert np.max(np.abs(rows["past_N"] - off)) < 0.05 * np.max(np.abs(off))
    top = rows[rows["level_kPa"] == view.top_level_kPa]
    limit = past(view)
    assert limit is not None and limit.level == "caution"
    assert f"{abs(top.groupby('branch')['past_N'].mean().mean()):.2g} N below" in limit.sentence
