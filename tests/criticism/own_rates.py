"""Loops of a muscle whose moduli each have exponentials of their own, from the tests' rig."""

from __future__ import annotations

import random

from prediction.coverage import as_specimen
from rig.chain import force_of
from rig.muscle import Law
from rig.protocol import Protocol, record_rows, sensor_noise
from rig.specimens import FAMILIES, loops_muscle, sensible, whole_levels

from mpam_calib.specimen.recording import Specimen


def made_with_rates_of_its_own() -> Specimen:
    """Second order, six levels: E_k = c_k exp(d_k P) + w_k exp(z_k P), all rates different."""
    muscle, top = loops_muscle(FAMILIES["thumb"], random.Random(3), law="linear", order=2)
    constants = tuple((0.8 * e, 0.8 / top * (k + 1), -0.4 * e, -5.0 / top) for k, (_, e) in enumerate(
        muscle.simulation.law.constants
    ))  # fmt: skip
    made = muscle.with_simulation(law=Law("exponential_each", constants))
    levels = whole_levels((0.4, 0.52, 0.64, 0.76, 0.88, 1.0), top)
    assert sensible(made, levels)
    protocol = Protocol(
        levels, cycles=2, rows_max=1200, noise_N=0.1, correlated_N=0.05, pressure_noise_kPa=0.0
    )
    rows = record_rows(protocol, made, 0)
    reading = force_of(made, rows) + sensor_noise(protocol, rows, 0)
    return as_specimen(made, rows, reading, protocol)
