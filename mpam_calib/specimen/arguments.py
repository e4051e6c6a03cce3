"""Arguments of the public functions, checked where they come in: the command line refuses the same."""

from __future__ import annotations

from numbers import Integral, Real
from typing import TypeGuard

from mpam_calib.errors import InputError
from mpam_calib.specimen.recording import Specimen


def demand_specimen(given: object) -> None:
    """Raise ``InputError`` for what is no specimen, such as its path."""
    if not isinstance(given, Specimen):
        raise InputError("SPECIMEN", _shown(given), "a Specimen, as mpam_calib.read(PATH) returns it")


def demand_whole(option: str, given: object, least: int) -> None:
    """Raise ``InputError`` unless an option is a whole number from ``least`` upwards."""
    if not isinstance(given, Integral) or isinstance(given, bool) or int(given) < least:
        raise InputError(option, _shown(given), f"a whole number from {least} upwards")


def demand_number(option: str, given: object, least: float) -> None:
    """Raise ``InputError`` unless an option is a finite number from ``least`` upwards."""
    if not is_number(given) or not least <= float(given) < float("inf"):
        raise InputError(option, _shown(given), f"a number from {least:g} upwards")


def is_number(given: object) -> TypeGuard[float]:
    """Whether something is a number, of Python or of numpy."""
    return isinstance(given, Real) and not isinstance(given, bool)


def _shown(given: object) -> str:
    return repr(given) if isinstance(given, Real) else f"{type(given).__name__} {str(given)[:40]!r}"
