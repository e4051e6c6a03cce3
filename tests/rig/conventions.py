"""What an effect's words leave open: other clocks, counts and strokes than the textbook form's.

Each is the textbook form with one thing taken otherwise, as another engineer may well take it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .chain import Form, State
from .effects import shared_form
from .muscle import Array
from .protocol import Rows


def _cycles_before(rows: Rows) -> Array:
    """Cycles of the whole test before the present one."""
    found, before = np.zeros(rows.count), 0.0
    for level in dict.fromkeys(rows.level.tolist()):
        here = rows.level == level
        found[here] = before + rows.cycle[here] - 1.0
        before += float(rows.cycle[here].max())
    return found


def _stiffer(excess: Callable[[Rows], Array]) -> Callable[[State, float], None]:
    def apply(state: State, size: float) -> None:
        gain = 1.0 + size * excess(state.rows)
        state.history.append(lambda force: force * gain)

    return apply


def _zero(path: Callable[[Rows], Array]) -> Callable[[State, float], None]:
    """Paths in minutes."""

    def apply(state: State, size: float) -> None:
        state.sensor = state.sensor + size * path(state.rows)

    return apply


def _drooping(share: Callable[[Rows], Array]) -> Callable[[State, float], None]:
    def apply(state: State, size: float) -> None:
        state.pressure = state.pressure * (1.0 - 0.01 * size * share(state.rows))

    return apply


def _there_and_back(rows: Rows) -> Array:
    """Minutes of a zero that wanders and comes back."""
    test = float(rows.time.max())
    return np.asarray(np.sin(2.0 * np.pi * rows.time / test) * test / 120.0)


def _first_stretching(rows: Rows) -> Array:
    return ((rows.cycle < 1.5) & (rows.direction < 0.0)).astype(float)


def _beyond_the_longest(rows: Rows) -> Array:
    """As new where nothing stretched it before; at the end of a stroke that did, less with every cycle."""
    near = np.clip(1.0 - (rows.stroke - rows.displacement) / (0.25 * rows.stroke), 0.0, 1.0)
    return np.where(_first_stretching(rows) > 0.0, 1.0, near * 0.5 ** (rows.cycle - 1.0))


def _further_than_ever(rows: Rows) -> Array:
    """As new within a tenth of the longest stroke so far, whichever level it was at."""
    longest = np.maximum.accumulate(rows.displacement)
    return np.exp(-(((longest - rows.displacement) / (0.1 * rows.displacement.max())) ** 2))


def _lagging(rows: Rows) -> Array:
    return rows.level_fraction * rows.nominal_speed / rows.nominal_speed.max()


def _sliding_at_first(state: State, size: float) -> None:
    rows = state.rows
    turning = 1.0 - 2.0 * np.exp(-rows.since_reversal / max(size, 1e-6))
    state.turn = state.turn * np.where(rows.travel <= rows.since_reversal * (1.0 + 1e-9), 1.0, turning)


def _slipping_one_by_one(state: State, size: float) -> None:
    """Four springs with sliders side by side, none of them under load when a level begins."""
    rows = state.rows
    first = rows.travel <= rows.since_reversal * (1.0 + 1e-9)
    ways = size * np.array([[0.3], [0.8], [1.6], [3.0]])
    loaded, turned = (
        np.minimum(times * rows.since_reversal / np.maximum(ways, 1e-6), 1.0).mean(axis=0)
        for times in (2.0, 1.0)
    )
    state.turn = state.turn * np.where(first, loaded, 2.0 * turned - 1.0)


def _steep_at_once(state: State, size: float) -> None:
    """A root of the travel up to full sliding: steep right after the turn."""
    part = np.minimum(state.rows.since_reversal / max(2.6 * size, 1e-6), 1.0) ** 0.5
    state.turn = state.turn * (2.0 * part - 1.0)


def _carried_over(state: State, size: float) -> None:
    """Bouc and Wen's friction (n = 2), from none when the test begins, carried on from level to level."""
    rows = state.rows
    turn, friction = np.zeros(rows.count), 0.0
    moves = -np.diff(rows.displacement, prepend=0.0) / max(size, 1e-6)
    for i, move in enumerate(moves):
        way = 1.0 if move > 0.0 else -1.0
        along, left = friction * way, abs(move)
        if along < 0.0:
            along, left = min(along + left, 0.0), max(left + along, 0.0)
        along = along if along < 0.0 else float(np.tanh(np.arctanh(min(along, 1.0 - 1e-12)) + left))
        friction = along * way
        turn[i] = friction * rows.direction[i]
    state.turn = state.turn * turn


def _by_the_stroke(state: State, size: float) -> None:
    """A power of the speed that the crosshead was set to, whatever it does at its turns."""
    speed = state.rows.nominal_speed
    v = speed / float(np.exp(np.mean(np.log(np.unique(speed)))))
    state.rate = state.rate * (1.0 + size * (v**0.4 - 1.0) / (0.4 * np.log(10.0)))


def _begun_before(state: State, size: float) -> None:
    """By a power of the time since the level was reached, 2.5 s before its first reading."""
    decades = ((1.0 + (state.rows.level_time + 2.5) / 0.8) ** 0.2 - 1.0) / (0.2 * np.log(10.0))
    state.history.append(lambda force: force * (1.0 - size * decades))


def _raised(state: State, size: float) -> None:
    """What a tensile test says holds without pressure; under it the moduli rise (or fall) and level off."""
    top = float(state.rows.setpoint.max())
    state.bends.append(lambda p: np.maximum(1.0 + size * -np.expm1(-2.0 * np.maximum(p, 0.0) / top), 0.02))


def _zeroed_anew(state: State, size: float) -> None:
    """An error of its own at each level, one as likely as the other sign."""
    state.shortening = state.shortening + size * 1.4 * np.sin(2.4 * (state.rows.level + 1.0))


def _by(name: str, effect: str, apply: Callable[[State, float], None]) -> Form:
    return replace(shared_form(effect), name=name, apply=apply, shared=False)


CONVENTIONS: dict[str, Form] = {
    form.name: form
    for form in (
        # The cell is tared before each file (which then has a clock of its own).
        _by("tared", "force_drift", _zero(lambda rows: rows.level_time / 60.0)),
        # The cell is tared when the muscle is mounted, some time before the first reading.
        _by("mounted_before", "force_drift", _zero(lambda rows: (rows.time + 45.0) / 60.0)),
        _by("there_and_back", "force_drift", _zero(_there_and_back)),
        # Rubber that softened at one level stays soft at the next.
        _by("softened_once", "stress_softening", _stiffer(lambda rows: 0.5 ** _cycles_before(rows))),
        # Only the first stretching is stiffer, not the way back.
        _by("first_stretching", "stress_softening", _stiffer(_first_stretching)),
        # Rubber is as new beyond its longest stretch so far.
        _by("beyond_the_longest", "stress_softening", _stiffer(_beyond_the_longest)),
        _by("further_than_ever", "stress_softening", _stiffer(_further_than_ever)),
        # No reversal begins a level's first stroke: friction does not turn over on it.
        _by("sliding_at_first", "presliding", _sliding_at_first),
        # Friction builds up from none on a level's first stroke: Maxwell's slip.
        _by("slipping_one_by_one", "presliding", _slipping_one_by_one),
        # Friction is none only when the test begins; every level goes on from where the one before ended.
        _by("carried_over", "presliding", _carried_over),
        # Friction turns over by a root of the travel.
        _by("steep_at_once", "presliding", _steep_at_once),
        # Friction goes by the speed that the stroke was driven with, the gentle turns included.
        _by("by_the_stroke", "rate_friction", _by_the_stroke),
        # A level is reached some time before its first reading.
        _by("begun_before", "creep", _begun_before),
        # The crosshead is zeroed anew at every level.
        _by("zeroed_anew", "length_offset", _zeroed_anew),
        # Pressure changes the moduli's mean as well.
        _by("raised", "law_shape", _raised),
        # Full stroke is each level's own.
        _by("own_stroke", "pressure_droop", _drooping(lambda rows: rows.level_fraction)),
        # A regulator that does not keep up: in proportion to the speed as well.
        _by("lagging", "pressure_droop", _drooping(_lagging)),
    )
}
