"""What one unit of a name's suffix is in SI, and how it is printed: by the metric system, not by the code."""

from __future__ import annotations

import numpy as np
import pytest

from mpam_calib import units
from mpam_calib.units import level_labels, si_factor, unit_of


@pytest.mark.parametrize(
    ("name", "in_si", "printed"),
    [
        ("pressure_kPa", 1000.0, "kPa"),
        ("stress_Pa", 1.0, "Pa"),
        ("E_br_GPa", 1_000_000_000.0, "GPa"),
        ("L0_mm", 0.001, "mm"),
        ("alpha0_deg", np.radians(1.0), "°"),
        ("force_N", 1.0, "N"),
        ("time_s", 1.0, "s"),
        ("compliance_mm_per_N", 0.001, "mm/N"),
        ("drift_N_per_min", 1.0 / 60.0, "N/min"),
        ("gain_percent", 0.01, "%"),
        ("contraction", 1.0, ""),
    ],
)
def test_one_unit_of_a_suffix(name: str, in_si: float, printed: str) -> None:
    assert si_factor(name) == pytest.approx(in_si, rel=1e-12)
    assert unit_of(name) == printed


def test_units_by_name() -> None:
    found = (units.KPA, units.MM, units.GPA, units.ATMOSPHERE, units.MINUTE, 180.0 * units.DEG)
    assert found == pytest.approx((1e3, 1e-3, 1e9, 101_325.0, 60.0, np.pi))


def test_levels_have_as_many_decimals_as_tell_them_apart() -> None:
    assert level_labels([50e3, 100e3]) == ["50", "100"]
    assert level_labels([100.01e3, 100.04e3, 200e3]) == ["100.01", "100.04", "200.00"]
    with pytest.raises(ValueError, match="not apart"):
        level_labels([100e3, 100e3])


def test_a_level_next_to_nothing_has_no_sign() -> None:
    assert level_labels([-200.0, 50e3]) == ["0", "50"]
    assert level_labels([-200.0, 200.0]) == ["-0.2", "0.2"]
    assert level_labels([-600.0, 50e3]) == ["-1", "50"]
