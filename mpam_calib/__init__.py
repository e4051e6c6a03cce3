"""Bayesian calibration of pneumatic artificial muscles.

The public names. They are imported at first use, so that ``import mpam_calib`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from mpam_calib.calibration import Calibration, calibrate
    from mpam_calib.errors import InputError, Interrupted, MpamError
    from mpam_calib.model.effect import Effect, Stage, known_effects, register
    from mpam_calib.model.priors import (
        HalfLongTailed,
        HalfNormal,
        LogNormal,
        LogUniform,
        LongTailed,
        Normal,
        Parameter,
        Uniform,
    )
    from mpam_calib.prediction.simulate import Simulated, simulate
    from mpam_calib.specimen import Specimen, read

    __version__: str

_HOME: Final = {
    "Calibration": "calibration",
    "Effect": "model.effect",
    "HalfLongTailed": "model.priors",
    "HalfNormal": "model.priors",
    "InputError": "errors",
    "Interrupted": "errors",
    "LogNormal": "model.priors",
    "LogUniform": "model.priors",
    "LongTailed": "model.priors",
    "MpamError": "errors",
    "Normal": "model.priors",
    "Parameter": "model.priors",
    "Simulated": "prediction.simulate",
    "Specimen": "specimen",
    "Stage": "model.effect",
    "Uniform": "model.priors",
    "calibrate": "calibration",
    "known_effects": "model.effect",
    "read": "specimen",
    "register": "model.effect",
    "simulate": "prediction.simulate",
}
"""The module of each public name."""

__all__ = [
    "Calibration",
    "Effect",
    "HalfLongTailed",
    "HalfNormal",
    "InputError",
    "Interrupted",
    "LogNormal",
    "LogUniform",
    "LongTailed",
    "MpamError",
    "Normal",
    "Parameter",
    "Simulated",
    "Specimen",
    "Stage",
    "Uniform",
    "__version__",
    "calibrate",
    "known_effects",
    "read",
    "register",
    "simulate",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is first asked for."""
    value: object
    if name == "__version__":
        from importlib.metadata import version

        value = version("mpam-calib")
    elif name in _HOME:
        value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
