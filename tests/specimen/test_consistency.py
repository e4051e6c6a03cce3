"""How much a simulation asks of its data: pressure levels for its law, rows for its parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen.consistency import check_levels, least_parameters
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.toml_source import TomlSource, read_toml

from .folders import make


@pytest.fixture
def source(tmp_path: Path) -> TomlSource:
    return read_toml(make(tmp_path) / "specimen.toml")


@pytest.mark.parametrize(
    ("law", "moduli"),
    [("constant", 3), ("linear", 6), ("exponential", 8), ("exponential_each", 12), ("free", 15)],
)
def test_a_law_s_parameters_are_counted(law: str, moduli: int) -> None:
    """Of order 3 at 5 levels: c, w and two rates, shared or of each modulus; or a modulus a level."""
    simulation = Simulation(law=law, order=3, friction="none")
    assert least_parameters(simulation, 5) == moduli + 1
    rubbed = simulation.model_copy(update={"friction": "coulomb", "effects": ("dead_band", "tip_shape")})
    assert least_parameters(rubbed, 5) == moduli + 1 + 2 + 1
    assert least_parameters(rubbed.model_copy(update={"friction_by_pressure": True}), 5) == moduli + 5 + 2 + 1
    assert least_parameters(rubbed.model_copy(update={"moduli": "tensile"}), 5) == 1 + 2 + 1


@pytest.mark.parametrize(
    ("law", "needed"),
    [("constant", 1), ("free", 1), ("linear", 2), ("exponential", 3), ("exponential_each", 3)],
)
def test_a_law_needs_levels_to_be_told_by(law: str, needed: int, source: TomlSource) -> None:
    simulation = Simulation(law=law, order=1)
    levels = 5e4 * np.arange(1, needed + 1)
    check_levels(source, simulation, levels)
    if needed > 1:
        with pytest.raises(InputError, match=f"at least {needed} levels"):
            check_levels(source, simulation, levels[:-1])
        check_levels(source, simulation.model_copy(update={"moduli": "tensile"}), levels[:-1])
