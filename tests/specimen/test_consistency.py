"""How much a simulation asks of its data: pressure levels for its law, rows for its parameters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from mpam_calib.errors import InputError
from mpam_calib.specimen import read
from mpam_calib.specimen.consistency import check_levels, check_rows, least_parameters
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


RUBBER = '[specimen]\nname = "rubber"\n[files]\ntensile = "t.csv"\n[simulation]\norder = 2\n'


@pytest.mark.parametrize(
    ("rows", "limits", "said"),
    [
        pytest.param(
            12,
            "[100.0, 200.0]",
            "toml:8:fit.tensile_strain: found 0 of 12 rows between 100 and 200, expected at least 3, "
            "one for each parameter of the simulation; the strains run from 0 to 1.1",
            id="per cent",
        ),
        pytest.param(12, "[0.5, 0.6]", "found 2 of 12 rows between 0.5 and 0.6, expected", id="narrow"),
        pytest.param(2, "[0.0, 1.0]", "t.csv: found 2 rows of data, expected at least 3", id="short file"),
        pytest.param(12, "[0.5, 0.7]", "", id="enough"),
    ],
)
def test_a_strain_range_of_few_rows_is_refused_where_it_is(
    rows: int, limits: str, said: str, tmp_path: Path
) -> None:
    test = "".join(f"{0.1 * k:.1f},{5e3 * k:g}\n" for k in range(rows))
    declared = f"{RUBBER}[fit]\ntensile_strain = {limits}\n"
    folder = make(tmp_path, declared, t="strain,stress_Pa\n" + test)
    if not said:
        assert read(folder).tensile is not None
        return
    with pytest.raises(InputError) as error:
        read(folder)
    assert said in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(("rows", "said"), [(0, "0 rows"), (1, "1 row"), (2, "2 rows")])
def test_rows_are_counted_in_words(rows: int, said: str) -> None:
    with pytest.raises(InputError, match=f"t.csv: found {said} of data, expected at least 3, one for"):
        check_rows("t.csv", rows, 3)
