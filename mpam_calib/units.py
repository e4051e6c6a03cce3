"""Laboratory units at the edge, SI inside: the only place where the two meet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

KPA: Final = 1e3
"""pascals in a kilopascal"""
MM: Final = 1e-3
"""metres in a millimetre"""
GPA: Final = 1e9
"""pascals in a gigapascal"""
DEG: Final = math.pi / 180.0
"""radians in a degree"""
ATMOSPHERE: Final = 101.325 * KPA
"""the standard atmosphere, pascals"""
MINUTE: Final = 60.0
"""seconds in a minute"""
DECIMALS: Final = 7
"""More decimals than any two levels (kPa) need to be told apart."""

_SUFFIXES: Final[dict[str, float]] = {
    "_kPa": KPA,
    "_Pa": 1.0,
    "_GPa": GPA,
    "_mm": MM,
    "_deg": DEG,
    "_N": 1.0,
    "_s": 1.0,
    "_mm_per_N": MM,
    "_N_per_min": 1.0 / MINUTE,
    "_percent": 0.01,
}


def si_factor(name: str) -> float:
    """SI units in one unit of the quantity called ``name``, read off its suffix (1 without one).

    >>> si_factor("pressure_kPa")
    1000.0
    >>> si_factor("compliance_mm_per_N")
    0.001
    >>> si_factor("contraction")
    1.0
    """
    for suffix in sorted(_SUFFIXES, key=len, reverse=True):
        if name.endswith(suffix):
            return _SUFFIXES[suffix]
    return 1.0


def level_labels(levels: Sequence[float] | NDArray[np.float64]) -> list[str]:
    """Pressures (Pa) as names of parameters carry them: whole kPa, or decimals until they can be told apart.

    >>> level_labels([50e3, 100e3])
    ['50', '100']
    >>> level_labels([12.1e3, 12.4e3])
    ['12.1', '12.4']
    >>> level_labels([-200.0, 50e3])
    ['0', '50']
    """
    for decimals in range(DECIMALS):
        labels = [f"{level / KPA:z.{decimals}f}" for level in levels]
        if len(set(labels)) == len(labels):
            return labels
    raise ValueError(f"levels that are not apart: {levels}")


def unit_of(name: str) -> str:
    """The unit that a column or parameter name ends in, in print form ("" without one).

    >>> unit_of("drift_N_per_min")
    'N/min'
    >>> unit_of("K_f")
    ''
    """
    for suffix in sorted(_SUFFIXES, key=len, reverse=True):
        if name.endswith(suffix):
            return suffix[1:].replace("_per_", "/").replace("deg", "°").replace("percent", "%")
    return ""
