"""Numbers as a reader wants them: rounded to what their band supports, all parts alike."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from typing import Any

import pandas as pd

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
LARGE, SMALL = 1e5, 1e-3
"""Beyond these a number is written with a power of ten."""


def decimals(uncertainty: float) -> int:
    """Decimals that a value with this uncertainty deserves; negative: round to tens, hundreds, ...

    Two digits of the uncertainty where it begins with 1 or 2 or exceeds 10, otherwise one (after the
    Particle Data Group's rule).

    >>> decimals(0.55), decimals(0.12), decimals(14.0), decimals(4100.0), decimals(0.0)
    (1, 2, 0, -2, 3)
    """
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 3
    exponent = math.floor(math.log10(uncertainty))
    leading = uncertainty / 10.0**exponent
    return -exponent + (1 if leading < 3.0 or exponent > 0 else 0)


def probability(p: float) -> str:
    """A probability that is never said to be certain.

    >>> probability(1.0), probability(0.9712), probability(2e-9)
    ('> 0.999', '0.971', '< 0.001')
    """
    if p > 0.999:
        return "> 0.999"
    return "< 0.001" if p < 0.001 else f"{p:.3g}"


def with_band(mean: float, low: float, high: float, median: float | None = None) -> tuple[str, str]:
    """Value and band "low–high", with the decimals that half the band supports.

    A mean outside its own band says nothing of where the value lies: the median stands in for it, marked.

    >>> with_band(94.3214, 93.81, 94.9)
    ('94.3', '93.8–94.9')
    >>> with_band(-8.93e7, -9.9e7, -8.1e7)
    ('−8.9×10⁷', '−9.9 – −8.1 ×10⁷')
    >>> with_band(7.3e16, -1.6e5, 5.9e5, 2.4e5)
    ('2×10⁵ (median)', '−2 – 6 ×10⁵')
    """
    outside = math.isfinite(mean) and not low <= mean <= high and low < high
    value = median if outside else mean
    largest = max(abs(low), abs(high))
    power = 0
    if math.isfinite(largest) and largest > 0 and not SMALL <= largest < LARGE:
        power = math.floor(math.log10(largest))
    scale = 10.0**-power
    n = decimals(scale * (high - low) / 2.0)
    joint = " – " if low < 0 else "–"
    band = f"{fixed(scale * low, n)}{joint}{fixed(scale * high, n)}"
    band = f"{band} {ten_to(power)}" if power else band
    if value is None:
        return f"{significant(mean, 2)} (mean, outside the band)", band
    text = f"{fixed(scale * value, n)}{ten_to(power) if power else ''}"
    return f"{text} (median)" if outside else text, band


def row_with_band(row: pd.Series | Mapping[Hashable, Any], factor: float = 1.0) -> tuple[str, str]:
    """:func:`with_band` of a row of ``summary.csv`` or ``bands.csv``, times a factor."""
    return with_band(*(factor * float(row[q]) for q in ("mean", "q05", "q95", "q50")))


def with_open_end(mean: float, low: float, end: float, median: float) -> tuple[str, str]:
    """Value and band of what was looked for up to an ``end`` only, and in some draws not found by then.

    >>> with_open_end(21.3, 19.12, 22.5, 21.6)
    ('at least 21.3', '19.1 to beyond 22.5')
    """
    value, band = with_band(mean, low, end, median)
    return f"at least {value}", f"{band.split('–')[0]} to beyond {end:.3g}"


def ten_to(power: int) -> str:
    """The factor as it is printed behind a number.

    >>> ten_to(-4)
    '×10⁻⁴'
    """
    return f"×10{superscript(power)}"


def superscript(power: int) -> str:
    """An integer as a superscript."""
    return str(power).translate(_SUPERSCRIPTS)


def fixed(value: float, n: int) -> str:
    """The value with n decimals (negative: rounded to tens, ...), a true minus sign and no minus zero.

    >>> fixed(-0.004, 2), fixed(-1.5, 1), fixed(79929.0, -2)
    ('0.00', '−1.5', '79900')
    """
    if not math.isfinite(value):
        return "–"
    text = f"{round(value, n):.{max(n, 0)}f}"
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def significant(value: float, digits: int = 3) -> str:
    """The value with so many significant digits.

    >>> significant(0.073456), significant(89588.0, 2), significant(-1.0822e8), significant(9.996)
    ('0.0735', '90000', '−1.08×10⁸', '10.0')
    """
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    if SMALL <= abs(value) < LARGE:
        return fixed(value, digits - 1 - int(power))
    return f"{mantissa.replace('-', '−')}{ten_to(int(power))}"
