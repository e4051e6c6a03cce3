"""A load cell that gives way near the end of its range, or whose zero or gain differs from level to level.

No cause of the contract's, and never named: whoever sees it has to look at the cell, not at the muscle. But
what it explains must not pass for the muscle's doing.
"""

from __future__ import annotations

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfLongTailed, LogNormal, LogUniform, LongTailed, Parameter
from mpam_calib.model.state import Setting, State

FROM, TO = 0.03, 3.0
"""Force scales from which on it may give way: from the first newtons, or only beyond all readings."""

MOST = 10.0
"""Force scales beyond the knee up to which it is followed: on its way a climb may pass any force."""


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    scale = setting.force_scale
    return (
        Parameter("cell_loss_N", HalfLongTailed(0.2 * scale), "lost one force scale above the knee"),
        Parameter(
            "cell_knee_N", LogUniform(FROM * scale, TO * scale), "reading from which the cell gives way"
        ),
        Parameter("cell_exponent", LogNormal(2.0, 0.4), "power of the reading beyond the knee", unit=""),
    )


def _apply(state: State, values: Values, setting: Setting) -> State:
    beyond = np.clip((state.guide - values["cell_knee_N"]) / setting.force_scale, 0.0, MOST)
    return state._replace(zero=state.zero - values["cell_loss_N"] * beyond ** values["cell_exponent"])


def _zeroed(state: State, values: Values, setting: Setting) -> State:
    """The cell is zeroed anew at every level; between levels it is off as on average."""
    zeros = [np.asarray(values[p.name]) for p in _zeros(setting)]
    table = np.concatenate([*zeros, sum(zeros) / len(zeros)], axis=-1)
    return state._replace(zero=state.zero + table[..., state.readings.level])


def _zeros(setting: Setting) -> tuple[Parameter, ...]:
    prior = LongTailed(0.05 * setting.force_scale)
    return tuple(
        Parameter(f"cell_zero_{i}_N", prior, f"zero at level {i}, from the lowest")
        for i in range(1, len(setting.levels) + 1)
    )


def _rescaled(state: State, values: Values, setting: Setting) -> State:
    """The cell's gain is another at every level (a loose plug, a range switched over)."""
    gains = [np.asarray(values[p.name]) for p in _gains(setting)]
    table = np.concatenate([*gains, sum(gains) / len(gains)], axis=-1)
    return state._replace(gain=state.gain * (1.0 + table[..., state.readings.level]))


def _gains(setting: Setting) -> tuple[Parameter, ...]:
    prior = LongTailed(0.05)
    return tuple(
        Parameter(f"cell_gain_{i}", prior, f"gain at level {i}, from the lowest, less 1", unit="")
        for i in range(1, len(setting.levels) + 1)
    )


register(
    Effect(
        id="load_cell",
        stage=Stage.SENSOR,
        title="Load cell that gives way",
        sentence="the load cell shows less and less of the force near the end of its range",
        told_by="dead weights up to the blocked force",
        source="reading = force − loss × (reading − knee)^m / force scale^m",
        parameters=_parameters,
        apply=_apply,
        memory=False,
        uses_force=True,
        forms={"zeroed": _zeroed, "rescaled": _rescaled},
        own={"zeroed": _zeros, "rescaled": _gains},
        leading={"zeroed": 0, "rescaled": 0},
        sources={
            "zeroed": "textbook: repeatability of a zero, an error of its own for each level",
            "rescaled": "textbook: repeatability of a gain, an error of its own for each level",
        },
        fault=True,
    )
)
