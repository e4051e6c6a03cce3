"""Numbers beside their bands: scaled by the band, and no mean that lies outside it."""

from __future__ import annotations

from mpam_calib.report.numbers import significant, with_band


def test_an_absurd_mean_gives_way_to_the_median() -> None:
    """A few draws of a heavy tail carry the mean off; band and value keep the band's own power of ten."""
    value, band = with_band(7.3e16, -1.6e5, 5.9e5, 2.4e5)
    assert (value, band) == ("2×10⁵ (median)", "−2 – 6 ×10⁵")


def test_without_a_median_the_mean_is_marked_and_the_band_stays_readable() -> None:
    value, band = with_band(-3.0e17, -1.2e6, 1.6e5)
    assert value == "−3.0×10¹⁷ (mean, outside the band)"
    assert band == "−1.2 – 0.2 ×10⁶"


def test_a_mean_inside_its_band_is_not_marked() -> None:
    assert with_band(94.3214, 93.81, 94.9, 94.2) == ("94.3", "93.8–94.9")
    assert with_band(1.0, 1.0, 1.0, 1.0)[0] == "1.000"


def test_rounding_up_to_a_power_of_ten_gives_no_further_digit() -> None:
    assert [significant(x) for x in (99.96, 99.94, 9.996, -0.9999)] == ["100", "99.9", "10.0", "−1.00"]
    assert significant(9.96, 2) == "10"
