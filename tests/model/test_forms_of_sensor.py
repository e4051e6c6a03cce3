"""Forms of the load cell's effects, each equation written out by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from .forms import DURATION, applied, rows, setting_for, shaped


@pytest.mark.parametrize(
    ("form", "own", "path"),
    [
        ("", {}, lambda t: t),
        (":settling", {}, lambda t: DURATION * np.log(1.0 + 20.0 * t / DURATION) / np.log(21.0)),
        (":early", {"tared_before_s": 40.0}, lambda t: t + 40.0),
        (":power", {"drift_exponent": 2.0}, lambda t: t**2 / 150.0),
        (":root", {}, lambda t: np.sqrt(150.0 * t)),
        (":return", {}, lambda t: 150.0 * np.sin(np.pi * t / DURATION)),
        (":swing", {"swing_s": 90.0, "swing_phase_deg": 0.4}, lambda t: 150.0 * np.sin(np.pi * t / 45 + 0.4)),
        (":thermal", {"warming_s": 70.0}, lambda t: 150.0 * (1 - np.exp(-t / 70)) / (1 - np.exp(-150 / 70))),
    ],
)  # fmt: skip
def test_a_zero_drifts_along_its_path(form: str, own: dict[str, float], path: Any) -> None:
    """Seconds of the plain line; but for the start and a swing all agree at half the test, or at its end."""
    setting = setting_for("force_drift")
    state = shaped(setting)
    after = applied(f"force_drift{form}", state, setting, drift_N_per_min=0.002, **own)
    np.testing.assert_allclose(np.ravel(after.zero), 0.002 * path(state.readings.time), atol=1e-12)


def test_a_cell_that_is_tared_drifts_anew_in_each_file() -> None:
    setting = setting_for("force_drift:tared")
    at = replace(rows(setting), file_time=np.arange(60.0) % 20.0)
    after = applied("force_drift:tared", shaped(setting, at), setting, drift_N_per_min=0.002)
    np.testing.assert_allclose(np.ravel(after.zero), 0.002 * at.file_time)


def test_a_load_cell_gives_way_beyond_its_knee_alone() -> None:
    setting = setting_for("force_drift")
    scale = setting.force_scale
    state = shaped(setting, rows(setting, 4))._replace(guide=scale * np.array([[-1.0, 0.4, 0.9, 1.4]]))
    own = {"cell_loss_N": 3.0, "cell_knee_N": 0.4 * scale, "cell_exponent": 2.0}
    after = applied("load_cell", state, setting, **own)
    np.testing.assert_allclose(after.zero, [[0.0, 0.0, -0.75, -3.0]], atol=1e-12)


def test_a_load_cell_s_zero_and_gain_are_each_level_s_and_else_the_mean() -> None:
    setting = setting_for("force_drift")
    at = replace(rows(setting, 5), level=np.array([0, 1, 2, 3, -1]))
    state, parts = shaped(setting, at), (1.0, -2.0, 3.0, 6.0)
    zeros = applied(
        "load_cell:zeroed", state, setting, **{f"cell_zero_{i + 1}_N": z for i, z in enumerate(parts)}
    )
    np.testing.assert_allclose(np.ravel(zeros.zero), [*parts, 2.0])
    gains = {f"cell_gain_{i + 1}": 0.01 * part for i, part in enumerate(parts)}
    found = applied("load_cell:rescaled", state, setting, **gains).gain
    np.testing.assert_allclose(np.ravel(found), [1.01, 0.98, 1.03, 1.06, 1.02])
