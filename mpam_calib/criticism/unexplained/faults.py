"""What a set of causes leaves in the raw readings that no cause may stand for."""

from __future__ import annotations

from dataclasses import astuple, dataclass

import numpy as np

from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import Fit
from mpam_calib.criticism.unexplained.bursts import bursts_rms
from mpam_calib.criticism.unexplained.chatter import chatter_rms
from mpam_calib.criticism.unexplained.converter import coarse_step
from mpam_calib.criticism.unexplained.hum import hum_rms
from mpam_calib.criticism.unexplained.repeat import raw_residual, repeating_rms
from mpam_calib.criticism.unexplained.wave import wave_rms
from mpam_calib.model.noise import grown

REPEAT_SIZE = 0.2
"""Fine structure that repeats, in a reading's noise, from which on it counts: it passes for noise itself."""

NOTHING = 0.02
"""A fault of less than this share of a reading's noise is none: readings nearly without noise have bursts of
rounding."""


@dataclass(frozen=True)
class Faults:
    """Each is 0 where there is none that matters.

    ``saturated`` is the share of the readings at the end of the load cell's range, ``repeating`` (N) fine
    structure that the strokes share, ``bursts`` (N) readings that stand out of their strokes, ``hum`` (N) one
    frequency in all readings, ``step`` (N) that of a converter coarser than the noise, ``chatter`` (N) what
    the readings scatter more one way than the other.
    """

    saturated: float = 0.0
    repeating: float = 0.0
    bursts: float = 0.0
    hum: float = 0.0
    step: float = 0.0
    chatter: float = 0.0

    def __bool__(self) -> bool:
        return any(astuple(self))


FAULTLESS = Faults()


def faults_of(problem: Problem, fitted: Fit) -> Faults:
    """Faults that a fit leaves."""
    if problem.rows is None:
        return Faults(problem.saturated)
    rows, noise = problem.rows, problem.noise_level
    residual = raw_residual(rows, problem.declared, fitted)
    grows = grown(np.array(noise.growth), rows.force, problem.force_scale)
    repeating = repeating_rms(rows, residual)
    # Tails that were declared are no bursts.
    bursts = 0.0 if problem.blueprint.noise.robust else bursts_rms(rows, residual, grows)
    hum = max(hum_rms(rows, residual), wave_rms(rows, residual))
    chatter = chatter_rms(rows, residual, grows)
    bursts, hum, chatter = (x if x > NOTHING * noise.total else 0.0 for x in (bursts, hum, chatter))
    return Faults(
        saturated=problem.saturated,
        repeating=repeating if repeating > REPEAT_SIZE * noise.total else 0.0,
        bursts=bursts,
        hum=hum,
        step=coarse_step(rows.force, noise.total),
        chatter=chatter,
    )
