"""Moduli that are free at each level say nothing of other pressures: bands widen by how they change.

Of muscles for pressures beyond the levels they follow the pressure in a straight line, of those for pressures
between in curves of many kinds, which the fit is not told.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest
from model import build
from rig.muscle import Law, Muscle, static_force

from mpam_calib.model.blueprint import Options
from mpam_calib.model.model import Model
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction import curves
from mpam_calib.prediction.curves import Reach, force_curves
from mpam_calib.prediction.free_moduli import BENT, moduli_change
from mpam_calib.specimen.recording import Specimen

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
    part = replace(part, loops=loops, levels_Pa=whole.levels_Pa[list(kept)])
    levels = part.levels_Pa
    spacing = float(np.diff(levels).mean()) if len(levels) > 1 else float(levels[0])
    asked = [levels[-1] + d * spacing for d in DISTANCES] + [levels[0] - d * spacing for d in DISTANCES]
    return fitted(seed, muscle, part, np.array([P for P in asked if P > 1e3]))


def fitted(seed: int, muscle: Muscle, specimen: Specimen, pressures: Array) -> Case:
    """Moduli of each level's own."""
    simulation = specimen.simulation.model_copy(update={"law": "free"})
    specimen = replace(specimen, simulation=simulation)
    model, draws = posterior_draws(specimen, specimen, Options(), seed, exact=False)
    contraction = ALONG * float(Reach.of(model.blueprint).contraction.max())
    truth = static_force(muscle, pressures[:, None] / 1e3, contraction[None, :])
    return Case(model, draws, pressures, contraction, truth.reshape(len(pressures), len(contraction)))


BENDS: dict[str, Callable[[Array], Array]] = {
    "exponential": lambda s: np.exp(1.5 * s - 1.0),
    "steep": lambda s: np.exp(3.0 * s - 2.4),
    "falling": lambda s: 0.4 + 1.5 * np.exp(-3.0 * s),
    "root": np.sqrt,
    "square": lambda s: 0.3 + s**2,
    "saturating": lambda s: 1.1 - np.exp(-4.0 * s),
    "step": lambda s: 1.0 + 0.6 * np.tanh((s - 0.6) / 0.12),
}
"""How many times their size the moduli are at a share of the highest pressure."""
LEVELS = (4, 6, 8)


@dataclass(frozen=True)
class Bent(Law):
    """Moduli of one size (Pa) each times one of the BENDS, at shares of the highest pressure (kPa)."""

    top_kPa: float = 1.0

    def moduli(self, pressure_kPa: Array, setpoint_kPa: Array) -> Array:
        share = np.maximum(np.asarray(pressure_kPa, float) / self.top_kPa, 0.0)
        return np.asarray(self.constants)[:, :1] * BENDS[self.name](share)


def bent_case(seed: int, bend: str, count: int) -> Case:
    """Pressures half way between neighbouring levels."""
    shares = tuple(np.linspace(0.3, 1.0, count).round(3))
    muscle, rows, _, reading, protocol = rig_case(seed, shares, lambda law, top: bent(law, bend, top))
    specimen = as_specimen(muscle, rows, reading, protocol)
    levels = specimen.levels_Pa
    return fitted(seed, muscle, specimen, 0.5 * (levels[1:] + levels[:-1]))


def bent(straight: Law, bend: str, top_kPa: float) -> Law:
    """A law of as large moduli in the middle as a straight one."""
    sizes = straight.moduli(np.array([0.5 * top_kPa]), np.array([0.5 * top_kPa]))
    return Bent(bend, tuple((float(size),) for size in sizes[:, 0]), top_kPa=top_kPa)


@pytest.fixture(scope="module")
def bent_cases() -> list[Case]:
    return [bent_case(seed, bend, count) for seed, count in enumerate(LEVELS) for bend in BENDS]


@pytest.fixture(scope="module")
def cases() -> list[Case]:
    return [case(seed, kept) for seed in range(MUSCLES) for kept in RECORDED]


def share(cases: list[Case]) -> float:
    return float(np.mean(np.concatenate([each.held().ravel() for each in cases])))


def test_bands_hold_the_true_forces_half_a_spacing_and_one_beyond(cases: list[Case]) -> None:
    assert share(cases) >= 0.9


def test_moduli_that_stay_as_they_are_miss_them(cases: list[Case], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curves, "moduli_change", lambda *_: None)
    assert share(cases) < 0.6


def test_bands_hold_the_true_forces_between_levels_whose_moduli_bend(bent_cases: list[Case]) -> None:
    assert 0.8 <= share(bent_cases) <= 0.99


def test_straight_lines_between_levels_miss_them(
    bent_cases: list[Case], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(curves, "moduli_change", lambda *_: None)
    assert share(bent_cases) < 0.6


def change(case: Case, pressures: Array) -> Array:
    """Draws (N, n), N, at one length; each deviate 1."""
    model, draws = case.model, case.draws
    assert model.setting is not None and model.chain is not None
    eta = draws.eta[:, : model.linear_sizes[0]]
    unknown = np.ones((len(eta), 2 + len(model.setting.levels)))
    found = moduli_change(model.chain, draws.values, eta, Readings.at_rest(pressures, 0.004), unknown)
    assert found is not None
    return found


def test_it_is_zero_at_the_levels_and_goes_on_from_there(cases: list[Case], bent_cases: list[Case]) -> None:
    for one in (cases[0], cases[1], bent_cases[0]):
        assert one.model.setting is not None
        levels = one.model.setting.levels
        assert not change(one, levels).any()
        middle = np.abs(change(one, 0.5 * (levels[1:] + levels[:-1]))).mean(axis=0)
        assert (middle > 0.0).all()
        near = np.concatenate([levels - 1.0, levels + 1.0])
        assert np.abs(change(one, near)).mean(axis=0).max() < 0.01 * middle.max()


def test_two_levels_bend_by_a_share_of_their_change(cases: list[Case]) -> None:
    two = cases[1]
    assert two.model.setting is not None
    low, high = two.model.setting.levels
    assert change(two, np.array([0.5 * (low + high)])) == pytest.approx(
        BENT * change(two, np.array([2.0 * high - low])), rel=1e-6
    )


def test_nothing_changes_under_a_law(cases: list[Case]) -> None:
    one = cases[0]
    assert one.model.chain is not None
    law = one.model.chain.setting.simulation.model_copy(update={"law": "linear"})
    chain = replace(one.model.chain, setting=replace(one.model.chain.setting, simulation=law))
    rows = Readings.at_rest(one.pressures, 0.004)
    assert moduli_change(chain, one.draws.values, one.draws.eta, rows, np.ones((1, 1))) is None
