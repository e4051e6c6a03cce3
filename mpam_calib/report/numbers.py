"""Numbers as a reader wants them: rounded to what their band supports, all parts alike."""

from __future__ import annotations

import math

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def decimals(uncertainty: float) -> int:
    """Decimals that a value with this uncertainty deserves.

    Two digits of the uncertainty where it begins with 1 or 2, otherwise one (the Particle Data
    Group's rule, simplified); never negative.

    >>> decimals(0.55), decimals(0.12), decimals(14.0), decimals(0.0)
    (1, 2, 0, 3)
    """
    if not math.isfinite(uncertainty) or uncertainty <= 0:
        return 3
    exponent = math.floor(math.log10(uncertainty))
    leading = uncertainty / 10.0**exponent
    return max(0, -exponent + (1 if leading < 3.0 else 0))


def with_band(mean: float, low: float, high: float) -> tuple[str, str]:
    """Value and band "low–high", with the decimals that half the band supports.

    >>> with_band(94.3214, 93.81, 94.9)
    ('94.3', '93.8–94.9')
    >>> with_band(-8.93e7, -9.9e7, -8.1e7)
    ('−8.93×10⁷', '−9.90×10⁷ – −8.10×10⁷')
    """
    if max(abs(mean), abs(low), abs(high)) >= 1e6:
        return significant(mean), f"{significant(low)} – {significant(high)}"
    n = decimals((high - low) / 2.0)
    joint = " – " if low < 0 else "–"
    return fixed(mean, n), f"{fixed(low, n)}{joint}{fixed(high, n)}"


def fixed(value: float, n: int) -> str:
    """The value with n decimals and a true minus sign; a negative zero loses its sign.

    >>> fixed(-0.004, 2), fixed(-1.5, 1)
    ('0.00', '−1.5')
    """
    if not math.isfinite(value):
        return "–"
    text = f"{value:.{n}f}"
    return text.lstrip("-") if float(text) == 0 else text.replace("-", "−")


def significant(value: float, digits: int = 3) -> str:
    """The value with so many significant digits; powers of ten beyond a million and below 1/1000.

    >>> significant(0.073456), significant(123456.0), significant(-1.0822e8), significant(0.0)
    ('0.0735', '123456', '−1.08×10⁸', '0')
    """
    if not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if 1e-3 <= abs(value) < 1e6:
        exponent = math.floor(math.log10(abs(value)))
        return fixed(value, max(0, digits - 1 - exponent))
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa.replace('-', '−')}×10{str(int(power)).translate(_SUPERSCRIPTS)}"
