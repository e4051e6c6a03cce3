"""A gauge may read below 0 (a vacuum, an offset): what settles with the pressure must not run away there."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.model.chain import Chain
from mpam_calib.model.curves import settled
from mpam_calib.model.effect import effect
from mpam_calib.model.readings import Readings
from mpam_calib.units import KPA

from . import build

LEVELS = (-50.0, 60.0)
DRAWS = 400
FORMS = ("dead_band:soft", "wall_pressure:seated")


def chain_and_values(form: str, levels: tuple[float, ...]) -> tuple[Chain, dict[str, np.ndarray]]:
    """The gas and the wall alone, and draws from the prior."""
    declared = {"law": "linear", "order": 2, "effects": (form,)}
    setting = build.blueprint(declared, recorded=build.loops(levels)).setting()
    assert setting is not None
    chain = Chain(setting, None, False)
    u = np.random.default_rng(0).standard_normal((DRAWS, len(chain.parameters)))
    return chain, {p.name: p.prior.from_normal(u[:, i : i + 1]) for i, p in enumerate(chain.parameters)}


@pytest.mark.parametrize("form", FORMS)
def test_forces_under_vacuum_are_of_a_usual_size(form: str) -> None:
    """They came to 1e163 force scales."""
    chain, values = chain_and_values(form, LEVELS)
    way = np.linspace(0.0, chain.setting.stroke, 9)
    found = chain.terms(values, Readings.at_rest(np.full(9, LEVELS[0] * KPA), way)).fixed
    assert np.all(np.isfinite(found))
    assert np.abs(found).max() < 100.0 * chain.setting.force_scale


def test_from_no_pressure_on_they_are_as_their_equations_say() -> None:
    pressure = np.linspace(0.0, 2.5e5, 60)
    readings = Readings.at_rest(pressure, np.full(60, 0.004))
    chain, values = chain_and_values("dead_band:soft", (100.0, 200.0))
    band = values["P_DB_kPa"]
    lost = band * -np.expm1(-pressure / np.maximum(np.abs(band), 1.0))
    state = effect("dead_band:soft").apply(chain.start(readings, np.zeros(60)), values, chain.setting)
    np.testing.assert_array_equal(state.pressure, np.maximum(pressure - lost, 0.0))
    constant = np.array([[1e3], [8e4]])
    share = np.expm1(-pressure / constant) / np.expm1(-1e5 / constant)
    np.testing.assert_array_equal(settled(pressure, constant, 1e5), share)
