"""What the errata say of the equations and statements, beside the numbers that they speak of."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib.thesis import decoded, laws
from mpam_calib.thesis.errata import Erratum, errata
from mpam_calib.thesis.ledger import Ledger
from mpam_calib.thesis.tables import table


@pytest.fixture(scope="module")
def found() -> dict[str, Erratum]:
    return {e.place: e for e in errata(Ledger())}


def test_r2_of_the_moduli_is_no_squared_correlation(found: dict[str, Erratum]) -> None:
    places = next(place for place in found if place.startswith("Tables 4.2"))
    assert places == "Tables 4.2, 4.6, 4.11"


def test_the_second_exponential_matters_beyond_50_kpa_for_one_modulus(found: dict[str, Erratum]) -> None:
    c, d, w, z = table("4.9").values()
    second = w * np.exp(100.0 * z)
    share = np.abs(second / (c * np.exp(100.0 * d) + second))
    assert share[:4].max() < 1e-9 and share[4] == pytest.approx(0.40, abs=0.005)
    proof = found["Fig. 4.19, Eq. 4.8"].proof
    assert "for k <= 4" in proof and "40 % at 100 kPa" in proof


def test_how_much_smaller_the_moduli_at_50_kpa_are(found: dict[str, Erratum]) -> None:
    E = np.abs(decoded.moduli("MPAM2"))
    assert (E[1:] / E[0]).min() == pytest.approx(41, abs=0.5)
    assert (E[1:] / E[0]).max() == pytest.approx(5296, abs=0.5)
    assert "41 to 5,296 times" in found["Fig. 4.19, Eq. 4.8"].proof


def test_statements_without_a_number_are_quoted(found: dict[str, Erratum]) -> None:
    assert "almost identical" in found["Text 4.4"].printed
    assert "1.21 to 1.35" in found["Text 4.4"].proof
    rest = decoded.bladder_at_rest("MPAM2")
    assert rest.size == laws.P_KPA.size and rest.max() == pytest.approx(19.07, abs=0.01)
    assert "does not have any impact" in found["Text 2.3.1"].printed
    assert "+19.1 N" in found["Text 2.3.1"].proof
