"""What ``check`` says about a tensile test that is hardly meant."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from mpam_calib.specimen import read
from mpam_calib.specimen.oddities import oddities

from .folders import make

Array = NDArray[np.float64]
DECLARED = '[specimen]\nname = "Rubber"\n[files]\ntensile = "tensile.csv"\n'

STRAIN = np.linspace(0.02, 2.0, 60)
STRESS = 4e4 * STRAIN + 8e3 * STRAIN**2
QUESTIONS = ("is it in pascals?", "are they stretches?", "is the way back", "did the test piece break")


def asked(folder: Path, strain: Array, stress: Array, declared: str = DECLARED) -> tuple[list[str], str]:
    """The questions among :data:`QUESTIONS` that are asked, and all remarks."""
    rows = "".join(f"{e:.5g},{s:.6g}\n" for e, s in zip(strain, stress, strict=True))
    found = " ".join(oddities(read(make(folder, declared, tensile="strain,stress_Pa\n" + rows))))
    return [question for question in QUESTIONS if question in found], found


def joined(*parts: Array) -> Array:
    return np.concatenate(parts)


@pytest.mark.parametrize(
    ("strain", "stress", "question", "said"),
    [
        pytest.param(STRAIN + 1.0, STRESS, 1, "strains from 1.02, where", id="stretches"),
        pytest.param(
            joined(STRAIN, STRAIN[::-1]), joined(STRESS, 0.9 * STRESS[::-1]), 2,
            "falls from 2 to 0.02 over 60 rows;", id="way back",
        ),
        pytest.param(
            joined(STRAIN, [2.02, 2.04]), joined(STRESS, [50.0, 0.0]), 3,
            "Pa to 0 Pa beyond a strain of 2 (2 rows)", id="break",
        ),
        pytest.param(STRAIN, 1e-3 * STRESS, 0, "a stiffness of about 48 Pa", id="kilopascals"),
        pytest.param(STRAIN, 1e-3 * 25.0 * STRESS, 0, "a stiffness of about 1.2e+03 Pa", id="latex in kPa"),
        pytest.param(STRAIN, 1e3 * STRESS, 0, "a stiffness of about 4.8e+07 Pa", id="millipascals"),
    ],
)  # fmt: skip
def test_what_is_hardly_meant_is_asked(
    strain: Array, stress: Array, question: int, said: str, tmp_path: Path
) -> None:
    questions, found = asked(tmp_path, strain, stress)
    assert questions == [QUESTIONS[question]] and said in found


@pytest.mark.parametrize(
    ("strain", "stress"),
    [
        pytest.param(STRAIN, STRESS, id="plain"),
        pytest.param(STRAIN, 0.2 * STRESS, id="soft"),
        pytest.param(STRAIN, 200.0 * STRESS, id="hard rubber"),
        pytest.param(STRAIN[30:], STRESS[30:], id="strains from 1 alone"),
        pytest.param(joined(STRAIN, STRAIN[:40]), joined(STRESS, 0.7 * STRESS[:40]), id="two tests"),
        pytest.param(
            joined(STRAIN[:40], STRAIN),
            joined(1.5 * STRESS[:40], 0.5 * STRESS),
            id="a soft test that goes on",
        ),
        pytest.param(STRAIN, np.minimum(STRESS, 8e4) - 1e3 * STRAIN, id="yields"),
    ],
)
def test_a_sound_test_is_not_asked_about(strain: Array, stress: Array, tmp_path: Path) -> None:
    noise = np.random.default_rng(0)
    steps = strain + 0.004 * noise.normal(size=len(strain))
    assert asked(tmp_path, steps, stress + 200.0 * noise.normal(size=len(stress)))[0] == []


def test_a_break_beyond_what_is_fitted_is_not_asked_about(tmp_path: Path) -> None:
    declared = DECLARED + "[fit]\ntensile_strain = [0.05, 1.9]\n"
    assert asked(tmp_path, joined(STRAIN, [2.02]), joined(STRESS, [0.0]), declared)[0] == []
