"""Effects of what has happened before: softening, creep; and the load cell's wandering zero."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ..chain import Form, State
from ..muscle import Array, Muscle
from ..protocol import Rows
from .rig_stage import blocked_top

# --- softening: excess of the first cycle -----------------------------------------------------------------


def _softening(kind: str) -> Callable[[State, float], None]:
    """F (1 + f g): g is 1 in a level's first cycle and falls to 0 (cycle, travelled way, contraction)."""

    def apply(state: State, size: float) -> None:
        rows = state.rows
        c = rows.cycle - 1.0
        g = {
            "exponential": np.exp(-c),
            "power": (1.0 + c) ** -1.5,
            "first_only": np.where(c < 0.5, 1.0, 0.0),
            "travel": 1.6 * np.exp(-rows.travel / (2.0 * rows.stroke)),
            "contraction": np.exp(-c) * (0.7 + 0.6 * rows.level_fraction),
        }[kind]
        state.history.append(lambda force: force * (1.0 + size * g))

    return apply


# --- creep: share per decade of the time at a level -------------------------------------------------------


def _creep(kind: str) -> Callable[[State, float], None]:
    """F (1 - c h(t)); h is near log10(1 + t/1 s) at the level's end for every form."""

    def apply(state: State, size: float) -> None:
        t = state.rows.level_time
        end = max(float(t.max()), 2.0)
        decades = np.log10(1.0 + end)
        if kind == "standard_solid":
            state.history.append(lambda force: force - size * decades * _relaxed(force, t, end / 3.0))
            return
        h = {
            "log": np.log10(1.0 + t),
            "stretched": decades * (1.0 - np.exp(-((4.0 * t / end) ** 0.5))) / (1.0 - np.exp(-2.0)),
            "power": decades * ((1.0 + t) ** 0.2 - 1.0) / ((1.0 + end) ** 0.2 - 1.0),
            "two_times": decades
            * (0.5 * (1 - np.exp(-t / (0.03 * end))) + 0.5 * (1 - np.exp(-t / (0.4 * end)))),
        }[kind]
        state.history.append(lambda force: force * (1.0 - size * h))

    return apply


def _relaxed(force: Array, level_time: Array, tau: float) -> Array:
    """q' = (F - q)/tau from q = 0 at every level's start, stepped exactly between rows."""
    out = np.zeros_like(force)
    gaps = np.diff(level_time, prepend=0.0)
    q = 0.0
    for i, (f, gap) in enumerate(zip(force.tolist(), gaps.tolist(), strict=True)):
        if gap < 0.0 or i == 0:
            q = 0.0
        else:
            q += (f - q) * (1.0 - np.exp(-gap / tau))
        out[i] = q
    return out


# --- drift of the load cell's zero: N per minute ----------------------------------------------------------


def _drift(kind: str) -> Callable[[State, float], None]:
    """Zero at the start; each form has the mean slope `size` over the test."""

    def apply(state: State, size: float) -> None:
        t = state.rows.time
        u = t / t.max()
        rng = np.random.default_rng([state.seed, 21])
        phases = rng.uniform(0.0, 2.0 * np.pi, 4)
        if kind == "wander":  # a smooth random walk: a slope and slow waves whose size falls with frequency
            waves = sum(
                (np.sin(np.pi * (j + 1) * u + a) - np.sin(a)) / (j + 1) ** 2 for j, a in enumerate(phases)
            )
            path = u + 0.25 * waves
        else:
            path = {
                "linear": u,
                "thermal": (1.0 - np.exp(-3.0 * u)) / (1.0 - np.exp(-3.0)),
                "late": 0.4 * u + 0.6 * u**2,
            }[kind]
        state.sensor = state.sensor + size * float(t.max()) / 60.0 * path

    return apply


def _drift_unit(m: Muscle, rows: Rows) -> float:
    return 0.01 * blocked_top(m, rows) / (float(rows.time.max()) / 60.0)


def _constant(value: float) -> Callable[[Muscle, Rows], float]:
    return lambda m, rows: value


def _form(
    effect: str,
    name: str,
    parameter: str,
    apply: Callable[[State, float], None],
    unit: Callable[[Muscle, Rows], float],
    stage: str = "history",
    **more: Any,
) -> Form:
    return Form(effect, name, parameter, stage, apply, unit, **more)


FORMS: tuple[Form, ...] = (
    *(
        _form(
            "stress_softening",
            name,
            "first_cycle_fraction",
            _softening(name),
            _constant(0.03),
            shared=name == "exponential",
        )
        for name in ("exponential", "power", "first_only", "travel", "contraction")
    ),
    *(
        _form("creep", name, "creep_per_decade", _creep(name), _constant(0.015), shared=name == "log")
        for name in ("log", "stretched", "power", "two_times", "standard_solid")
    ),
    *(
        _form(
            "force_drift",
            name,
            "drift_N_per_min",
            _drift(name),
            _drift_unit,
            stage="sensor",
            signed=True,
            shared=name == "linear",
        )
        for name in ("linear", "thermal", "late", "wander")
    ),
)
