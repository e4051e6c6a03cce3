"""Moduli that are free at each level say nothing of pressures beyond these: bands widen by how they change.

The muscles' moduli follow the pressure in a straight line, which the fit is not told.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from model import build
from rig.muscle import static_force

from mpam_calib.model.blueprint import Options
from mpam_calib.model.model import Model
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction import curves
from mpam_calib.prediction.curves import Reach, force_curves
from mpam_calib.prediction.free_moduli import moduli_beyond

from .coverage import Array, as_specimen, posterior_draws, rig_case

MUSCLES = 6
RECORDED = ((2, 4, 6), (2, 4), (4,))
"""Which of the seven levels, at 40 to 100 % of the highest, are calibrated on."""
DISTANCES = (0.5, 1.0)
"""From the outer levels, in spacings."""
ALONG = np.array([0.3, 0.6, 0.9])
"""Of the contraction that was recorded at the highest level."""


@dataclass(frozen=True)
class Case:
    """A fit of one muscle, unrecorded pressures (P,), Pa, contractions, and the true force there."""

    model: Model
    draws: Draws
    pressures: Array
    contraction: Array
    truth: Array

    def held(self) -> Array:
        """Whether the 90 % bands of the force without friction hold it (P, contractions)."""
        force = force_curves(self.model, self.draws, self.pressures, self.contraction, 0).force[:, :, 2]
        low, high = np.quantile(force, [0.05, 0.95], axis=0)
        return np.asarray((low <= self.truth) & (self.truth <= high))


def case(seed: int, kept: tuple[int, ...]) -> Case:
    muscle, rows, _, reading, protocol = rig_case(seed)
    whole = as_specimen(muscle, rows, reading, protocol)
    part = build.take_levels(whole, list(kept))
    assert part.loops is not None
    loops = replace(part.loops, level=np.searchsorted(kept, part.loops.level))
    simulation = whole.simulation.model_copy(update={"law": "free"})
    part = replace(part, loops=loops, levels_Pa=whole.levels_Pa[list(kept)], simulation=simulation)
    model, draws = posterior_draws(part, part, Options(), seed, exact=False)
    levels = part.levels_Pa
    spacing = float(np.diff(levels).mean()) if len(levels) > 1 else float(levels[0])
    asked = [levels[-1] + d * spacing for d in DISTANCES] + [levels[0] - d * spacing for d in DISTANCES]
    pressures = np.array([P for P in asked if P > 1e3])
    contraction = ALONG * float(Reach.of(model.blueprint).contraction.max())
    truth = static_force(muscle, pressures[:, None] / 1e3, contraction[None, :])
    return Case(model, draws, pressures, contraction, truth.reshape(len(pressures), len(contraction)))


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return [case(seed, kept) for seed in range(MUSCLES) for kept in RECORDED]


def share(cases: list[Case]) -> float:
    return float(np.mean(np.concatenate([each.held().ravel() for each in cases])))


def test_bands_hold_the_true_forces_half_a_spacing_and_one_beyond(cases: list[Case]) -> None:
    assert share(cases) >= 0.9


def test_moduli_that_stay_as_they_are_miss_them(cases: list[Case], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curves, "moduli_beyond", lambda *_: None)
    assert share(cases) < 0.6


def test_nothing_changes_at_the_levels_between_them_or_under_a_law(cases: list[Case]) -> None:
    one = cases[0]
    assert one.model.setting is not None
    levels = one.model.setting.levels
    at = Readings.at_rest(np.append(levels, 0.5 * (levels[0] + levels[1])), 0.004)
    changed = moduli_beyond(one.model, one.draws.values, one.draws.eta, at)
    assert changed is not None and not changed.any()
    law = one.model.setting.simulation.model_copy(update={"law": "linear"})
    other = replace(one.model, setting=replace(one.model.setting, simulation=law))
    assert moduli_beyond(other, one.draws.values, one.draws.eta, at) is None
