"""Rows along which the force is strongly curved, under a simulation that is far off."""

from __future__ import annotations

import numpy as np
from rig import case as rig_case
from rig.muscle import Braid, Geometry, Law, Muscle, Simulation
from rig.protocol import Protocol

from criticism.cases import problem_of, read_case
from mpam_calib.criticism.data.problem import Problem
from mpam_calib.criticism.fitting.fit import fit

MODULI = (145e3, 4.2e3, 1.3e3)
THICK = Muscle(
    "thick",
    Geometry(180.0, 12.0, 2.3, 71.5),
    Braid(2.1, 0.33, 0.4, 48),
    Simulation(
        friction="none",
        friction_value=(),
        law=Law("constant", tuple((E,) for E in MODULI)),
        declared_E_Pa=MODULI,
    ),
)
"""Its wall resists stretching at once: the force falls steeply from its first millimetres on."""


def problem(noise_N: float) -> Problem:
    protocol = Protocol(
        (120.0, 240.0, 360.0, 480.0, 600.0),
        speeds_mm_s=(20.0,),
        sampling_hz=100.0,
        rows_max=10_000,
        noise_N=noise_N,
        correlated_N=0.6 * noise_N,
    )
    hidden = (rig_case.Hidden("braid_angle", "uniform", -2.8),)
    one = rig_case.Case("thick", 1, "separable", THICK, protocol, hidden)
    return problem_of(read_case(one))


def test_moduli_that_stand_in_for_a_cause_do_not_bend_the_rows() -> None:
    """Moduli of five times their declared size are the declared simulation's best answer to the angle.

    Their force is curved where the muscle's is not, and the truth itself must not pay for that.
    """
    loud, clean = problem(3.0), problem(3e-4)
    recorded = loud.with_force(clean.force)
    angle = fit(recorded, frozenset(["braid_angle"]), 0)
    assert 0.5 * angle.chi2 < 5.0
    # Where the force bends rows are looked at in two places, and the mean over a row is exact.
    _, first, second = recorded.lean
    assert np.sum(first != second) > 0
    assert np.abs(recorded.bow / np.sqrt(np.diagonal(recorded.noise))).max() <= 0.1
