"""Options of the public functions that mean nothing are told as the command line tells them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import mpam_calib as mc

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def rubber() -> mc.Specimen:
    return mc.read(ROOT / "datasets" / "ecoflex_tension")


CALIBRATE: dict[str, tuple[dict[str, Any], str]] = {
    "a seed below 0": ({"seed": -1}, "--seed: found -1, expected a whole number from 0 upwards"),
    "a seed that is a fraction": ({"seed": 1.5}, "--seed: found 1.5, expected a whole number"),
    "a seed in words": ({"seed": "one"}, "--seed: found str 'one', expected a whole number"),
    "no steps": ({"max_steps": 0}, "--max-steps: found 0, expected a whole number from 1 upwards"),
    "no draws": ({"ess_wanted": 0.0}, "--ess: found 0.0, expected a number from 1 upwards"),
    "draws without end": ({"ess_wanted": float("inf")}, "--ess: found inf, expected a number"),
    "options in a number": ({"options": 5}, "options: found 5, expected Options or None"),
    "a material in words": ({"material": "x"}, "material: found str 'x', expected MaterialPosterior or None"),
    "not a number of draws": ({"ess_wanted": float("nan")}, "--ess: found nan, expected a number"),
}


@pytest.mark.parametrize("name", CALIBRATE)
def test_an_option_of_calibrate_that_means_nothing(name: str, rubber: mc.Specimen) -> None:
    options, said = CALIBRATE[name]
    with pytest.raises(mc.InputError) as error:
        mc.calibrate(rubber, **options)
    assert str(error.value).startswith(said)


def test_a_specimen_without_data_cannot_be_calibrated(tmp_path: Path) -> None:
    declared = '[simulation]\nmoduli = "tensile"\nE_Pa = [4.0e4]\n'
    geometry = "[geometry]\nL0_mm = 50\nR0_mm = 3\nt0_mm = 0.7\nalpha0_deg = 72\n"
    (tmp_path / "specimen.toml").write_text(f'[specimen]\nname = "x"\n{geometry}{declared}')
    specimen = mc.read(tmp_path, data_required=False)
    with pytest.raises(mc.InputError) as error:
        mc.calibrate(specimen)
    assert str(error.value).startswith(f"{tmp_path / 'specimen.toml'}:files: found no data files, expected ")


@pytest.mark.parametrize("function", [mc.calibrate, mc.simulate])
@pytest.mark.parametrize("given", ["datasets/ecoflex_tension", Path("datasets/ecoflex_tension"), None])
def test_what_is_no_specimen(given: object, function: Callable[[object], object]) -> None:
    with pytest.raises(mc.InputError, match=r"SPECIMEN: found .*, expected a Specimen, as mpam_calib\.read"):
        function(given)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"seed": -1}, "--seed: found -1, expected a whole number from 0 upwards"),
        ({"hide": {"dead_band": "abc"}}, "--hide: found dead_band='abc', expected effect ids with sizes"),
        ({"hide": {1: 2.0}}, "--hide: found 1=2.0, expected effect ids with sizes"),
        ({"hide": ["dead_band"]}, "--hide: found list ['dead_band'], expected effect ids with sizes"),
    ],
)
def test_an_option_of_simulate_that_means_nothing(
    options: dict[str, Any], said: str, rubber: mc.Specimen
) -> None:
    with pytest.raises(mc.InputError) as error:
        mc.simulate(rubber, **options)
    assert str(error.value).startswith(said)


def test_an_effect_hidden_in_two_forms_is_hidden_twice() -> None:
    muscle = mc.read(ROOT / "datasets" / "mpam1_reconstructed")
    with pytest.raises(mc.InputError, match="--hide: found creep twice, expected each effect once"):
        mc.simulate(muscle, {"creep": 0.01, "creep:power": None})


@pytest.mark.parametrize("given", [None, 5, b"x", ["x"], "a\0b"])
def test_what_is_no_path(given: Any) -> None:
    with pytest.raises(mc.InputError, match=r"SPECIMEN: found .*, expected the path of a specimen's folder"):
        mc.read(given)


@pytest.fixture(scope="module")
def pressures() -> Callable[[Any], object]:
    """A muscle's bands, as far as its pressures are looked at."""

    class Muscle:
        chain = object()

    found = object.__new__(mc.Calibration)
    vars(found)["target"] = type("Target", (), {"model": Muscle()})()
    return found.bands


@pytest.mark.parametrize(
    "given", [[], 5, ["x"], [[100.0, 200.0]], [[1.0], [1.0, 2.0]], [float("nan")], [-5.0], [1e4], [None], "x"]
)
def test_what_are_no_pressures_for_bands(given: Any, pressures: Callable[[Any], object]) -> None:
    with pytest.raises(mc.InputError, match=r"pressures_kPa: found .*, expected a list of pressures in kPa"):
        pressures(given)


def test_numpy_s_numbers_are_numbers(rubber: mc.Specimen) -> None:
    found = mc.calibrate(rubber, seed=np.int64(3), max_steps=np.int32(40), ess_wanted=np.float64(50.0))
    assert found.seed == 3
