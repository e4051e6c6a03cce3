"""Bent effects: the same cause with a shape of its own.

No rig follows an equation to the letter: a fixture stiffens, relaxation is no straight line over the
logarithm of time. An effect declared as ``id:bent`` has its size multiplied by a smooth positive
function of what drives it, exp(Σ c_j P_j(v)), with Legendre polynomials P_1, P_2 ... of a driver v in about
−1..1 (the contraction, the pressure, the time ...) and c_j ~ N(0, (looseness·BEND/j)²). So a name survives an
equation that is not quite the real one, and pays for the freedom in its evidence. Along the contraction and
the time of the test the factor is the polynomial 1 + Σ c_j P_j(v) itself: what grows with the square of the
stroke instead of the stroke, or a zero that comes back, has a factor that passes through nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.curves import over_mean
from mpam_calib.model.priors import Normal, Parameter
from mpam_calib.model.readings import Readings
from mpam_calib.model.state import Setting, State

Array = NDArray[np.float64]

FORM: Final = "bent"
"""The form's name: ``id:bent``."""
BENDS: Final = "_bend_"
"""What the names of its coefficients hold, beside those of the effect's own parameters."""
BEND: Final[Mapping[str, float]] = {
    **dict.fromkeys(("contraction", "pressure"), 0.25),
    **dict.fromkeys(("force", "speed", "pace"), 0.4),
}
"""Prior sd of the first bend: a size that differs by ±25 % between the two ends of its driver ..."""
LOOSE: Final = 0.5
"""... and for the others, whose laws are the least known: how things fade with time, cycles and travel."""
MOST: Final = 3.0
"""Largest logarithm of the factor, whatever the coefficients."""
EARLY: Final = 20.0
"""Duration of the test over that of the part in which something that settles does most of it."""
LEAST_APART: Final = 0.02
"""Share of the top pressure by which lowest and top level count as apart at least."""
TURN_SHARE: Final = 0.01
"""Share of the stroke from which on the driver ``travel`` counts its decades."""
CYCLES: Final = 2.0
"""Cycles from the middle to the ends of the driver ``cycles``."""


def place_in_pressure(state: State, setting: Setting) -> Array:
    """The pressure, from −1 at the lowest level to 1 at the top; beside one level a regulator does little."""
    low, high = float(setting.levels[0]), setting.top_pressure
    return (2.0 * state.readings.pressure - low - high) / max(high - low, LEAST_APART * high, 1.0)


def _travel(state: State, setting: Setting) -> Array:
    travel = state.readings.travel / setting.stroke
    return np.asarray(2.0 * np.log1p(travel / TURN_SHARE) / np.log1p(1.0 / TURN_SHARE) - 1.0)


DRIVERS: Final[Mapping[str, Callable[[State, Setting], Array]]] = {
    "contraction": lambda state, setting: 2.0 * state.readings.displacement / setting.stroke - 1.0,
    "pressure": place_in_pressure,
    "force": lambda state, setting: np.abs(state.guide) / setting.force_scale - 1.0,
    "time": lambda state, setting: 2.0 * state.readings.time / max(setting.duration, 1.0) - 1.0,
    "settling": lambda state, setting: (
        2.0 * np.log1p(EARLY * state.readings.time / max(setting.duration, 1.0)) / np.log1p(EARLY) - 1.0
    ),
    "level_time": lambda state, setting: (
        2.0 * np.log1p(state.readings.time_at_level) / np.log1p(max(setting.level_time, 1.0)) - 1.0
    ),
    "cycle": lambda state, setting: 2.0 / state.readings.cycle - 1.0,
    "branch": lambda state, setting: state.readings.sign,
    "cycles": lambda state, setting: (state.readings.cycle - 1.0) / CYCLES - 1.0,
    "speed": lambda state, setting: np.log10(over_mean(state.readings.speed, setting)),
    "pace": lambda state, setting: np.log10(over_mean(state.readings.pace, setting)),
    "travel": _travel,
}
"""What a shape may bend with, in about −1..1 over the recordings: (n,) or (B, n)."""


POLYNOMIAL: Final = ("contraction", "time")
"""Drivers along which the factor is a polynomial and may vanish."""


def is_bend(name: str) -> bool:
    """Whether a parameter is such a coefficient; ``law_bend_1`` is a parameter of an effect, and is not."""
    return BENDS in name.removeprefix("law_bend_")


def bend_parameters(
    name: str, bends: Mapping[str, int], looseness: float, constant: bool
) -> tuple[Parameter, ...]:
    """The coefficients c_j of a size called ``name``; with a constant one where the size itself is none.

    Their prior sds are ``looseness`` times those of BEND.
    """
    found = (
        [Parameter(f"{name}{BENDS}0", Normal(0.0, LOOSE), "logarithm of the size", "", "")]
        if constant
        else []
    )
    number = 0
    for driver, degree in bends.items():
        for j in range(1, degree + 1):
            number += 1
            meaning = f"bend of the shape along {driver.replace('_', ' ')}, degree {j}"
            sd = looseness * BEND.get(driver, LOOSE) / j
            found.append(Parameter(f"{name}{BENDS}{number}", Normal(0.0, sd), meaning, "", ""))
    return tuple(found)


def bend_factor(
    name: str, bends: Mapping[str, int], values: Mapping[str, Array], state: State, setting: Setting
) -> Array:
    """exp(Σ c_j P_j(v)), or 1 + Σ c_j P_j(v) along POLYNOMIAL drivers, for every reading, (B, n)."""
    first, *others = _names(name, sum(bends.values()))
    constant = values.get(first, np.zeros_like(values[others[0]]))
    coefficients = np.concatenate([constant, *(values[other] for other in others)], axis=1)
    bases = {driver: _basis(driver, degree, state, setting) for driver, degree in bends.items()}
    return _factor(coefficients, bases)


@lru_cache(maxsize=1024)
def _names(name: str, degrees: int) -> tuple[str, ...]:
    """The coefficients' names, c_0 first."""
    return tuple(f"{name}{BENDS}{j}" for j in range(degrees + 1))


def _factor(coefficients: Array, bases: Mapping[str, Array]) -> Array:
    """:func:`bend_factor` of coefficients (B, 1 + degrees), c_0 first, and the bases of the drivers."""
    log, factor = coefficients[:, :1], np.ones((1, 1))
    first = 1
    for driver, basis in bases.items():
        total = _series(coefficients[:, first : first + len(basis)], basis)
        first += len(basis)
        if driver in POLYNOMIAL:
            factor = factor * (1.0 + total)
        else:
            log = log + total
    return np.asarray(factor * np.exp(np.clip(log, -MOST, MOST)))


_kept: list[tuple[Readings, Setting, dict[tuple[str, int], Array]]] = []
"""The readings and the setting last seen, with their bases: a climb looks at the same ones many times."""


def _bases_of(readings: Readings, setting: Setting) -> dict[tuple[str, int], Array]:
    """What is known of these readings so far."""
    last = _kept[0] if _kept else None
    if last is None or last[0] is not readings or last[1] is not setting:
        last = readings, setting, {}
        _kept[:] = [last]
    return last[2]


def _basis(driver: str, degree: int, state: State, setting: Setting) -> Array:
    """Legendre polynomials of a driver from the first to that degree, (degree, B or 1, n)."""
    bases = _bases_of(state.readings, setting)
    if driver != "force" and (driver, degree) in bases:  # the force is the state's own
        return bases[driver, degree]
    v = np.atleast_2d(np.clip(DRIVERS[driver](state, setting), -1.5, 1.5))
    basis = [v]
    for j in range(1, degree):
        basis.append(((2 * j + 1) * v * basis[-1] - j * (basis[-2] if j > 1 else 1.0)) / (j + 1))
    bases[driver, degree] = np.stack(basis)
    return bases[driver, degree]


def _series(coefficients: Array, basis: Array) -> Array:
    """Σ c_j P_j(v), (B, n), of coefficients (B, degree) and a basis (degree, B or 1, n)."""
    if basis.shape[1] == 1:  # alike for all: one product of matrices
        return np.asarray(coefficients @ basis[:, 0])
    return np.asarray(np.einsum("bj,jbn->bn", coefficients, basis))
