"""Whether the fitted noise is the sensor's: a misfit that no other part can hold goes into it."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from mpam_calib.model.noise import WHITE
from mpam_calib.report.blocks import Level
from mpam_calib.report.limit import Limit
from mpam_calib.report.numbers import significant
from mpam_calib.report.view import CalibrationView

NOISE_CAUTION: Final = 3.0
NOISE_BAD: Final = 10.0
"""Fitted noise over what is known of it ..."""
NOISE_BAD_SHARE: Final = 0.05
"""... and over the top force, where the numbers cannot be used, and where lasting noise is not ordinary."""
NEGLIGIBLE: Final = 0.005
"""Noise up to this share of the top force is worth no word."""


def noise_size(view: CalibrationView) -> Limit | None:
    """The fitted noise is far above what readings scatter by from one to the next, or what is declared.

    Noise that lasts for longer than a reading is a parameter of its own, and ordinary unless it is huge.
    """
    fitted, top = _fitted(view), top_force(view)
    reading, declared = _known(view.reading_noise), _known(view.declared_noise)
    beside = f"{_newtons(reading)} from reading to reading" if reading else ""
    if fitted > NEGLIGIBLE * top > 0.0:
        if reading and fitted > NOISE_CAUTION * reading:
            return _misfit(_level(fitted, reading, top), fitted, beside)
        if declared and fitted > NOISE_CAUTION * declared:
            words = f"the declared force_sd_N = {declared:g}"
            if reading:
                return _noisier(fitted, words)
            return _either(_level(fitted, declared, top), fitted, words)
    if reading and _level(view.noise, reading, top) == "bad":
        return _misfit("caution", view.noise, beside)
    return None


def lasting_noise(view: CalibrationView) -> Limit | None:
    """White noise and what lasts are together far above what is declared, though neither is a misfit.

    That is ordinary (a hum, a pressure that swings), and the bands hold it.
    """
    declared, whole = _known(view.declared_noise), _whole(view)
    if noise_size(view) is not None or not declared:
        return None
    if whole <= NOISE_CAUTION * declared or whole <= NEGLIGIBLE * top_force(view):
        return None
    words = f"a reading's noise is {_newtons(whole)}, against the declared force_sd_N = {declared:g}"
    sentence = (
        f"A{words[1:]}: it lasts over several readings, as a hum, a pressure that swings or a misfit "
        "does. The bands follow the readings; look at the load cell's cable and at the regulator."
    )
    return Limit("good", sentence, words)


def noise_as_declared(view: CalibrationView) -> bool:
    """Whether the noise of a reading, white and lasting, was held against a declared one and is near it."""
    declared, whole = _known(view.declared_noise), _whole(view)
    return declared is not None and whole <= NOISE_CAUTION * declared


def _level(fitted: float, known: float, top: float) -> Level:
    return "bad" if fitted > NOISE_BAD * known and fitted > NOISE_BAD_SHARE * top > 0.0 else "caution"


def _misfit(level: Level, fitted: float, beside: str) -> Limit:
    words = f"hat the simulation misses went into the noise: {_newtons(fitted)} against {beside}"
    sentence = (
        f"W{words}. Levels that are mixed up, a few wild readings or a wrong simulation do this; that the "
        "simulation fits to within such noise means nothing."
    )
    return Limit(level, sentence, f"w{words}")


def _either(level: Level, fitted: float, beside: str) -> Limit:
    """Without loops nothing tells noise from misfit."""
    words = f"the noise is {_newtons(fitted)} against {beside}"
    sentence = (
        f"T{words[1:]}. Either the load cell is noisier than declared, and the bands follow the readings, or "
        "what the simulation misses went into the noise, and that it fits to within that means nothing. "
        "Readings that are repeated in place tell which."
    )
    return Limit(level, sentence, words)


def _noisier(fitted: float, beside: str) -> Limit:
    sentence = (
        f"The readings scatter by {_newtons(fitted)}, against {beside}. The bands follow the readings; look "
        "at the load cell or at the declaration."
    )
    return Limit("caution", sentence, "the load cell is noisier than declared")


def _newtons(force: float) -> str:
    return f"{significant(force, 2)} N"


def _fitted(view: CalibrationView) -> float:
    rows = view.summary[view.summary["parameter"] == WHITE]
    return math.nan if rows.empty or view.tensile else float(rows["mean"].iloc[0])


def _whole(view: CalibrationView) -> float:
    """One sigma (N) of a reading's noise, whether new in it or lasting; nan where there is none."""
    return float(np.fmax(_fitted(view), math.nan if view.tensile else view.noise))


def _known(noise: float) -> float | None:
    return noise if noise > 0.0 else None


def top_force(view: CalibrationView) -> float:
    """The largest pull that was recorded, N; robust against single wild readings."""
    rows = view.readings("loops", "force_map", "blocked_force")
    force = rows.loc[~rows["censored"].astype(bool), "force_N"].abs()
    return float(force.quantile(0.99)) if len(force) else 0.0
