"""Structures that no effect of the catalogue describes: they must end as "unexplained".

Additive structures are built with unit shape and scaled so that their rms over the rows is `rms_N`. A clipped
or coarse sensor acts on the noisy signal; its threshold or step is solved for the same rms.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .muscle import Array
from .protocol import Rows


@dataclass(frozen=True)
class Outside:
    """A structure of `kind` with a root mean square of `rms_N` over the rows."""

    kind: str
    rms_N: float


def _spot(rng: np.random.Generator, low: float = 0.3, high: float = 0.7) -> float:
    return float(rng.uniform(low, high))


def _bump(rows: Rows, rng: np.random.Generator) -> Array:
    """A Gaussian bump at one length, both ways, all levels."""
    return np.exp(-0.5 * ((rows.fraction - _spot(rng, 0.2, 0.45)) / 0.04) ** 2)


def _notch(rows: Rows, rng: np.random.Generator) -> Array:
    """A skewed notch at one length: sharp on one side, with a tail on the other."""
    v = (rows.fraction - _spot(rng, 0.15, 0.4)) / 0.03
    return -np.where(v < 0.0, np.exp(-(v**2)), 1.0 / (1.0 + v**2))


def _ripple(rows: Rows, rng: np.random.Generator) -> Array:
    """A sine along the crosshead's way: a screw that is out of true."""
    return np.sin(2 * np.pi * (rng.uniform(11.0, 17.0) * rows.fraction + rng.uniform()))


def _gear(rows: Rows, rng: np.random.Generator) -> Array:
    """A triangular ripple along the way whose size grows with the stroke: a worn rack."""
    phase = (rng.uniform(13.0, 19.0) * rows.fraction + rng.uniform()) % 1.0
    return (0.4 + rows.fraction) * (4.0 * np.abs(phase - 0.5) - 1.0)


def _stick_slip(rows: Rows, rng: np.random.Generator) -> Array:
    """A sawtooth that builds up and lets go, against the motion."""
    way = rows.since_reversal / float(rows.displacement.max())
    return rows.direction * ((rng.uniform(14.0, 20.0) * way) % 1.0 - 0.5)


def _pressure_kink(rows: Rows, rng: np.random.Generator) -> Array:
    """One level alone is off, most at half its stroke."""
    level = int(rng.integers(1, int(rows.level.max()))) if rows.level.max() > 1 else 0
    return np.where(rows.level == level, np.sin(np.pi * rows.level_fraction) ** 2, 0.0)


def _snag(rows: Rows, rng: np.random.Generator) -> Array:
    """At one level and in one direction the braid snags near the end of the stroke."""
    level = int(rng.integers(1, int(rows.level.max()) + 1))
    here = (rows.level == level) & (rows.direction < 0)
    return np.where(here, np.exp(-0.5 * ((rows.level_fraction - 0.75) / 0.08) ** 2), 0.0)


def _bursts(rows: Rows, rng: np.random.Generator) -> Array:
    """Bursts of outliers of either sign, a handful of rows each."""
    out = np.zeros(rows.count)
    for start in rng.integers(0, rows.count - 8, size=max(6, rows.count // 200)):
        out[start : start + int(rng.integers(3, 8))] += rng.choice([-1.0, 1.0]) * rng.uniform(0.5, 1.5)
    return out


def _dropouts(rows: Rows, rng: np.random.Generator) -> Array:
    """One-sided drop-outs that recover exponentially."""
    out = np.zeros(rows.count)
    for start in rng.integers(0, rows.count - 12, size=max(6, rows.count // 250)):
        out[start : start + 12] -= rng.uniform(0.5, 1.5) * np.exp(-np.arange(12) / 3.0)
    return out


def _hum(rows: Rows, rng: np.random.Generator) -> Array:
    """A slow oscillation in time: a pump that cycles."""
    return np.sin(2 * np.pi * (rows.time / rng.uniform(5.0, 9.0) + rng.uniform()))


def _jump(rows: Rows, rng: np.random.Generator) -> Array:
    """The zero jumps in the middle of one level and jumps back two thirds of a stroke later."""
    level = int(rng.integers(0, int(rows.level.max()) + 1))
    inside = np.flatnonzero(rows.level == level)
    start = inside[int(rng.uniform(0.2, 0.6) * inside.size)]
    out = np.zeros(rows.count)
    out[start : start + max(8, inside.size // 9)] = 1.0
    return out


ADDITIVE: dict[str, Callable[[Rows, np.random.Generator], Array]] = {
    "bump": _bump,
    "notch": _notch,
    "ripple": _ripple,
    "gear": _gear,
    "stick_slip": _stick_slip,
    "pressure_kink": _pressure_kink,
    "snag": _snag,
    "bursts": _bursts,
    "dropouts": _dropouts,
    "hum": _hum,
    "jump": _jump,
}


def _clip(signal: Array, at: float) -> Array:
    """A saturated cell: nothing above `at`."""
    return np.minimum(signal, at)


def _floor_clip(signal: Array, at: float) -> Array:
    """An amplifier that saturates at the low end, at -`at`."""
    return np.maximum(signal, -at)


def _compress(signal: Array, at: float) -> Array:
    """A cell that saturates softly: a fifth of the slope above `at`."""
    return np.where(signal > at, at + 0.2 * (signal - at), signal)


def _quantise(signal: Array, step: float) -> Array:
    """A converter with too few bits."""
    return step * np.round(signal / step)


READOUT = ("clip", "floor_clip", "compress", "quantisation")
KINDS: tuple[str, ...] = (*ADDITIVE, *READOUT)


def _solved(
    apply: Callable[[Array, float], Array], signal: Array, low: float, high: float, rms_N: float
) -> float:
    """Setting between `low` (small change) and `high` (large) whose change has the wanted rms; bisection."""
    for _ in range(50):
        middle = 0.5 * (low + high)
        if float(np.sqrt(np.mean((apply(signal, middle) - signal) ** 2))) < rms_N:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def disturb(signal: Array, noise: Array, rows: Rows, outside: Outside, seed: int) -> tuple[Array, Array]:
    """(recorded force, noise-free force) with the structure in both."""
    if outside.kind in ADDITIVE:
        shape = ADDITIVE[outside.kind](rows, np.random.default_rng([seed, 31]))
        added = shape * outside.rms_N / max(float(np.sqrt(np.mean(shape**2))), 1e-12)
        return signal + noise + added, signal + added
    apply, low, high = {
        "clip": (_clip, float(signal.max()), float(np.median(signal))),
        "compress": (_compress, float(signal.max()), float(np.median(signal))),
        "floor_clip": (_floor_clip, -float(signal.min()), -float(np.median(signal))),
        "quantisation": (_quantise, 1e-6, float(np.ptp(signal))),
    }[outside.kind]
    setting = _solved(apply, signal, low, high, outside.rms_N)
    return apply(signal + noise, setting), apply(signal, setting)
