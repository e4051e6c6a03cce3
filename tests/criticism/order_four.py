"""Loops of muscles whose wall is of the fourth order with a linear law, as an engineer would record them.

The test rig makes them; it shares no code with the package.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from prediction.coverage import as_specimen
from rig.chain import force_of
from rig.muscle import Law, Muscle, free_contraction, static_force
from rig.protocol import Protocol, Rows, noise_sd, record_rows, sensor_noise
from rig.specimens import FAMILIES, loops_muscle, sensible, whole_levels

from mpam_calib.criticism.selection.space import model_space
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.specimen.recording import Specimen

Array = np.ndarray

NOISE = 0.003
"""Noise of a reading as a share of the blocked force at the highest level."""
FOURTH = (0.1, 0.5)
"""The fourth modulus as a share of the first."""
CONTRACTION = (0.62, 0.88)
"""Free contraction at the highest level as a share of that without a wall."""
MATTERS = 0.3
"""What the best third order leaves of the force, root mean square, in sds of a reading, at least.

With the protocol's 2,000 to 3,000 readings this is about fifteen standard errors.
"""


SURE = 10.0
"""Nats by which kinematics and strain convention must be expected to lose, to be told from the true ones."""


@dataclass(frozen=True)
class Case:
    """A recording, the simulation that made it, and the models in play."""

    specimen: Specimen
    truth: Simulation
    space: list[Simulation]


def draw_case(seed: int) -> Case:
    """One case; muscles whose fourth order does not matter are drawn again."""
    rng = random.Random(f"fourth order {seed}")
    while True:
        family = FAMILIES[rng.choice(sorted(FAMILIES))]
        friction = rng.choice(("coulomb", "strand"))
        muscle, top = loops_muscle(family, rng, law="linear", order=3, friction=friction)
        levels = whole_levels(tuple(np.linspace(0.3, 1.0, rng.choice((6, 7)))), top)
        muscle = _with_fourth(muscle, top, rng)
        if sensible(muscle, levels) and left_by_third(muscle, levels) >= MATTERS:
            break
    protocol = _protocol(muscle, levels)
    rows = record_rows(protocol, muscle, seed)
    reading = force_of(muscle, rows) + sensor_noise(protocol, rows, seed)
    specimen = as_specimen(muscle, rows, reading, protocol)
    truth = specimen.simulation.model_copy(update={"order": 4, "law": "linear", "friction": friction})
    # Declared is what somebody starts from who has not selected yet.
    declared = specimen.simulation.model_copy(update={"order": 2, "law": "constant", "friction": "coulomb"})
    specimen = replace(specimen, simulation=declared)
    pairs = told_apart(muscle, rows, protocol)
    return Case(specimen, truth, [s for s in model_space(specimen) if (s.kinematics, s.strain) in pairs])


def _protocol(muscle: Muscle, levels: tuple[float, ...]) -> Protocol:
    noise = NOISE * float(static_force(muscle, levels[-1], 0.0)[0])
    white = noise / float(np.hypot(1.0, 0.5))
    return Protocol(
        levels, cycles=2, rows_max=3000, stroke_fraction=0.85, noise_N=white, correlated_N=0.5 * white,
        correlation_s=0.15, pressure_noise_kPa=0.0,
    )  # fmt: skip


def _with_fourth(muscle: Muscle, top: float, rng: random.Random) -> Muscle:
    """The muscle with a fourth modulus, all moduli scaled to a usual free contraction."""
    law = muscle.simulation.law
    slope, constant = law.constants[0]
    share = rng.choice((1.0, -1.0)) * rng.uniform(*FOURTH)
    constants = np.array([*law.constants, (share * slope, share * constant)])

    def scaled(factor: float) -> Muscle:
        return muscle.with_simulation(
            law=Law("linear", tuple((factor * a, factor * b) for a, b in constants))
        )

    target = rng.uniform(*CONTRACTION) * free_contraction(scaled(0.0), top)
    low, high = 0.0, 8.0
    for _ in range(50):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if free_contraction(scaled(middle), top) > target else (low, middle)
    return scaled(middle)


def left_by_third(muscle: Muscle, levels: tuple[float, ...]) -> float:
    """What the best third order with a linear law leaves of the rows' force, rms in sds of a reading."""
    protocol = _protocol(muscle, levels)
    return _left(muscle, muscle, 3, record_rows(protocol, muscle, 0)) / noise_sd(protocol)


def told_apart(muscle: Muscle, rows: Rows, protocol: Protocol) -> set[tuple[str, str]]:
    """The true (kinematics, strain), and all that no order of theirs can save with a linear law.

    The log likelihood that the best fit is expected to lose, less half a logarithm of the readings for each
    constant that it saves (Schwarz), is at least SURE for every order. Correlated noise is counted as fewer
    readings.
    """
    dt = float(np.median(np.diff(rows.time)))
    rho = float(np.exp(-dt / protocol.correlation_s))
    density = protocol.noise_N**2 + protocol.correlated_N**2 * (1.0 + rho) / (1.0 - rho)
    true = muscle.simulation
    found = {(true.kinematics, true.strain)}
    for pair in product(("inextensible_braid", "constant_thickness"), ("engineering", "stretch")):
        other = muscle.with_simulation(kinematics=pair[0], strain=pair[1])
        loses = [
            0.5 * rows.count * _left(muscle, other, order, rows) ** 2 / density
            - (true.law.order - order) * np.log(rows.count)
            for order in range(1, 7)
        ]
        if min(loses) >= SURE:
            found.add(pair)
    return found


def _left(muscle: Muscle, other: Muscle, order: int, rows: Rows) -> float:
    """RMS (N) of what another muscle's moduli (linear law of this order) leave of a muscle's force."""
    unit = np.array(muscle.simulation.law.constants[0])
    nothing = np.zeros((order, 2))
    base = _force(other, nothing, rows)
    steps = np.eye(2 * order).reshape(2 * order, order, 2) * unit
    X = np.stack([_force(other, step, rows) - base for step in steps], axis=1)
    Q = np.linalg.svd(X / np.linalg.norm(X, axis=0), full_matrices=False)[0]
    missed = _force(muscle, np.array(muscle.simulation.law.constants), rows) - base
    return float(np.sqrt(np.mean((missed - Q @ (Q.T @ missed)) ** 2)))


def _force(muscle: Muscle, constants: Array, rows: Rows) -> Array:
    law = Law("linear", tuple((float(a), float(b)) for a, b in constants))
    changed = muscle.with_simulation(law=law)
    return static_force(changed, rows.pressure, rows.displacement / muscle.geometry.L0_mm)
