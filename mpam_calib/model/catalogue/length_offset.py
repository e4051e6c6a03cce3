"""Length offset: the crosshead's zero is not the muscle's rest length."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import half_test, middle_pressure, power, settled
from mpam_calib.model.effect import Apply, Effect, Share, Stage, Values, register
from mpam_calib.model.priors import LogNormal, LongTailed, Normal, Parameter
from mpam_calib.model.state import Setting, State
from mpam_calib.units import MM

Array = NDArray[np.float64]

GAIN: Final = 0.02
"""Prior scale of a displacement's gain error: ISO 9513 allows 1 % in class 1 and 2 % in class 2. Far more
than that is a muscle whose contraction counts otherwise (its ends: ``tip_shape:tapered``)."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("offset_mm", LongTailed(_usual(setting)), "true shortening minus the reading"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    return state._replace(displacement=state.displacement + values["offset_mm"])


def _off_by(part: Share) -> Apply:
    """The offset is so large a part of itself at each reading, (B or 1, n)."""

    def apply(state: State, values: Values, setting: Setting) -> State:
        off = values["offset_mm"] * part(state, values, setting)
        return state._replace(displacement=state.displacement + off)

    return apply


def _scale(state: State, values: Values, setting: Setting) -> Array:
    """The crosshead's scale is off: the error goes with the stroke, and is the offset at half of it."""
    return np.asarray(state.displacement / _half_stroke(setting))


def _gained(setting: Setting) -> tuple[Parameter, ...]:
    prior = LongTailed(GAIN * _half_stroke(setting))
    return (Parameter("offset_mm", prior, "true shortening minus the reading at half the stroke"),)


def _line(state: State, values: Values, setting: Setting) -> Array:
    """Zero and scale are both off: the error is a line in the stroke, and the offset at half of it."""
    share = values["scale_share"]
    return np.asarray(1.0 - share + share * state.displacement / _half_stroke(setting))


def _scale_share(setting: Setting) -> tuple[Parameter, ...]:
    prior = LongTailed(GAIN * _half_stroke(setting) / _usual(setting))
    return (Parameter("scale_share", prior, "share of the offset that is one of scale", "", ""),)


def _half_stroke(setting: Setting) -> float:
    return 0.5 * setting.stroke


def _usual(setting: Setting) -> float:
    """Prior scale of an offset, m."""
    return 0.02 * setting.geometry.L0


def _slip(state: State, values: Values, setting: Setting) -> Array:
    """The grips slip early in the test, and then hold: the offset at half the test."""
    return np.asarray(settled(state.readings.time, values["slip_s"], half_test(setting)))


def _slip_time(setting: Setting) -> tuple[Parameter, ...]:
    prior = LogNormal(0.4 * half_test(setting), 1.0)
    return (Parameter("slip_s", prior, "time in which the grips settle"),)


def _seating(state: State, values: Values, setting: Setting) -> Array:
    """The end fittings seat themselves under pressure: the offset is off by a power of it."""
    return np.asarray(power(state.pressure / middle_pressure(setting), values["offset_exponent"]))


def _exponent(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("offset_exponent", Normal(0.0, 0.5), "power of the pressure", "textbook", ""),)


def _settling(state: State, values: Values, setting: Setting) -> Array:
    """There from the start, and more or less of it at first."""
    return _excessive(values, np.exp(-state.readings.time / values["slip_s"]))


def _bedding(state: State, values: Values, setting: Setting) -> Array:
    """The same by the count of cycles: the grips bed in as they are loaded."""
    return _excessive(values, np.exp((1.0 - state.readings.test_cycle) / values["bedding_cycles"]))


def _excessive(values: Values, fading: Array) -> Array:
    return np.asarray(1.0 + values["offset_excess"] * fading)


def _bedding_in(setting: Setting) -> tuple[Parameter, ...]:
    cycles = Parameter("bedding_cycles", LogNormal(2.0, 0.7), "cycles in which the grips bed in", "", "")
    return _more_at_first(), cycles


def _excess(setting: Setting) -> tuple[Parameter, ...]:
    return (_more_at_first(), *_slip_time(setting))


def _more_at_first() -> Parameter:
    return Parameter("offset_excess", Normal(0.0, 0.7), "what is more of it at first, as a share", "", "")


def _rezeroed(state: State, values: Values, setting: Setting) -> Array:
    """The crosshead is zeroed anew at every level; between levels it is off as on average."""
    parts = [np.asarray(values[p.name]) for p in _parts(setting)]
    table = np.concatenate([*parts, sum(parts) / len(parts)], axis=-1)
    return np.asarray(table[..., state.readings.level])


def _parts(setting: Setting) -> tuple[Parameter, ...]:
    prior = Normal(1.0, 0.7)
    return tuple(
        Parameter(f"offset_level_{i}", prior, f"share of the offset at level {i}, from the lowest", "", "")
        for i in range(1, len(setting.levels) + 1)
    )


register(
    Effect(
        id="length_offset",
        stage=Stage.RIG,
        title="Length offset",
        sentence="the crosshead was zeroed at another length than the muscle's rest length",
        told_by="the crosshead's reading where the unpressurised muscle just goes taut",
        resolution={"offset_mm": 0.05 * MM},
        source="true shortening = reading + offset",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        of_test=True,
        forms={
            "scale": _off_by(_scale),
            "line": _off_by(_line),
            "slip": _off_by(_slip),
            "settling": _off_by(_settling),
            "bedding": _off_by(_bedding),
            "seating": _off_by(_seating),
            "rezeroed": _off_by(_rezeroed),
        },
        own={
            "scale": _gained,
            "line": _scale_share,
            "slip": _slip_time,
            "settling": _excess,
            "bedding": _bedding_in,
            "seating": _exponent,
            "rezeroed": _parts,
        },
        recalls=("slip", "settling", "bedding"),
        apart=("rezeroed",),
        sources={
            "scale": "textbook: gain error of a displacement sensor",
            "line": "textbook: a displacement sensor's calibration line, wrong in zero and gain",
            "slip": "textbook: first-order settling of a clamp, 1 − exp(−t/τ)",
            "settling": "textbook: an offset with an exponential transient, 1 + c·exp(−t/τ)",
            "bedding": "textbook: an offset that settles with each load cycle, 1 + c·exp(−N/n)",
            "seating": "textbook: end fittings that seat under pressure, δ·(P/P_middle)^m",
            "rezeroed": "textbook: repeatability of a zero, an error of its own for each level",
        },
        bends={"contraction": 1, "settling": 3},
    )
)
