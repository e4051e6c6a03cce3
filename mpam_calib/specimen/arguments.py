"""Arguments of the public functions, checked where they come in: the command line refuses the same."""

from __future__ import annotations

import os
from numbers import Integral, Real
from typing import TypeGuard

import numpy as np

from mpam_calib.errors import InputError
from mpam_calib.specimen.plausibility import HIGHEST_LEVEL_KPA
from mpam_calib.specimen.recording import Floats, Specimen


def demand_specimen(given: object) -> None:
    """Raise ``InputError`` for what is no specimen, such as its path."""
    if not isinstance(given, Specimen):
        raise InputError("SPECIMEN", _shown(given), "a Specimen, as mpam_calib.read(PATH) returns it")


def demand_path(given: object) -> None:
    """Raise ``InputError`` for what is no path."""
    if not isinstance(given, str | os.PathLike) or "\0" in str(given):
        raise InputError("SPECIMEN", _shown(given), "the path of a specimen's folder or specimen.toml")


def demand_optional(option: str, given: object, kind: type) -> None:
    """Raise ``InputError`` for what is neither left out nor of the kind that an option takes."""
    if given is not None and not isinstance(given, kind):
        raise InputError(option, _shown(given), f"{kind.__name__} or None")


def demand_pressures(option: str, given: object) -> Floats:
    """A list of gauge pressures (kPa) as an array (n,); raises ``InputError`` for anything else."""
    expected = f"a list of pressures in kPa from 0 to {HIGHEST_LEVEL_KPA:g}"
    try:
        pressures = np.asarray(given)
    except ValueError:  # rows of different lengths
        raise InputError(option, _shown(given), expected) from None
    if pressures.dtype.kind not in "iuf" or pressures.ndim != 1 or not len(pressures):
        raise InputError(option, _shown(given), expected)
    wrong = pressures[~((pressures >= 0.0) & (pressures <= HIGHEST_LEVEL_KPA))]
    if len(wrong):
        raise InputError(option, f"{wrong[0]:g}", expected)
    return pressures.astype(np.float64)


def demand_whole(option: str, given: object, least: int) -> None:
    """Raise ``InputError`` unless an option is a whole number from ``least`` upwards."""
    if not isinstance(given, Integral) or isinstance(given, bool) or int(given) < least:
        raise InputError(option, _shown(given), f"a whole number from {least} upwards")


def demand_number(option: str, given: object, least: float) -> None:
    """Raise ``InputError`` unless an option is a finite number from ``least`` upwards."""
    if not is_number(given) or not least <= float(given) < float("inf"):
        raise InputError(option, _shown(given), f"a number from {least:g} upwards")


def demand_finite(place: str, name: str, given: object, above: float = -float("inf")) -> None:
    """Raise ``InputError`` unless the value ``name`` of something is a finite number above a limit."""
    if not is_number(given) or not above < float(given) < float("inf"):
        limit = "a finite number" if above == -float("inf") else f"a number above {above:g}"
        raise InputError(place, _shown(given), limit, None, name)


def demand_name(place: str, name: str, given: object) -> None:
    """Raise ``InputError`` unless the value ``name`` of something is a word, as a table's rows have."""
    if not isinstance(given, str) or given.split() != [given]:
        raise InputError(place, _shown(given), "a word that ends in a unit, such as drift_N", None, name)


def is_number(given: object) -> TypeGuard[float]:
    """Whether something is a number, of Python or of numpy."""
    return isinstance(given, Real) and not isinstance(given, bool)


def _shown(given: object) -> str:
    return repr(given) if isinstance(given, Real) else f"{type(given).__name__} {str(given)[:40]!r}"
