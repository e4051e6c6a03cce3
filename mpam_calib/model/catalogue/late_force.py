"""A load cell that is read late: its amplifier filters, or the two channels have clocks of their own.

No cause of the contract's, and never named (as :mod:`mpam_calib.model.catalogue.load_cell`): the force read
at a length is that of a moment before, so that the loop opens as if something rubbed after every turn.
"""

from __future__ import annotations

import numpy as np

from mpam_calib.model.effect import Effect, Stage, Values, register
from mpam_calib.model.priors import HalfLongTailed, Parameter
from mpam_calib.model.state import Setting, State

USUAL = 0.1
"""Prior scale of the delay, s: a filter of a few hertz, or two instruments polled in turn."""
BLUR = 0.2
"""Share of the time since a turn over which the direction changes: rows are means of several readings."""
TINY = 1e-12


def _parameters(setting: Setting) -> tuple[Parameter, ...]:
    return (Parameter("cell_delay_s", HalfLongTailed(USUAL), "time by which the force is read late"),)


def _apply(state: State, values: Values, setting: Setting) -> State:
    """Length and direction of a moment before, which shortly after a turn are those of the stroke before.

    The way since a turn goes with a power of the time: one at an even speed, two where speed is gathered.
    """
    rows = state.readings
    power = 2.0 - np.clip(rows.speed / np.maximum(rows.pace, TINY), 0.0, 1.0)
    travel = np.maximum(rows.travel, TINY)
    # The time since the turn, less the delay, as a share of that time.
    left = 1.0 - values["cell_delay_s"] * rows.speed / (power * travel)
    before = np.where(rows.reversal > 0.0, left, np.maximum(left, 0.0))
    # Speeds next to a turn are rough: nobody goes farther than a half-wave's fastest in that time.
    most = 0.5 * np.pi * rows.pace * values["cell_delay_s"]
    # Shortening grows while unloading (sign −1).
    shift = rows.sign * np.clip(travel * (1.0 - np.abs(before) ** power), -most, most)
    past = np.clip(left / BLUR, -1.0, 1.0)
    sign = state.sign * np.where(rows.reversal > 0.0, past, 1.0)
    return state._replace(displacement=state.displacement + shift, sign=sign)


register(
    Effect(
        id="late_force",
        stage=Stage.RIG,
        title="Load cell that is read late",
        sentence="the force is read some time after the length that it is written beside",
        told_by="a sudden pull on the unpressurised rig, force and crosshead recorded together",
        source="reading(t) = force(t − delay)",
        parameters=_parameters,
        apply=_apply,
        fault=True,
    )
)
