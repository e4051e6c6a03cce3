"""The headline figures of muscles whose simulation is off by many times the noise.

The hyperelastic muscles of :mod:`.outside`, of which also a fifth of the pull may be lost, a dead-band and
an offset of the length be there, and the length be wrong by a few per cent: none of it is declared.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from rig.calibration import hyperelastic_muscle, write_calibration_case

from mpam_calib.model.blueprint import Options
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.specimen import read
from mpam_calib.specimen.recording import Specimen

from .coverage import posterior_draws

Array = np.ndarray
Curve = Callable[[Array, Array], Array]


@dataclass(frozen=True)
class AtFullLength:
    """Blocked forces (levels,), N: the true ones, and draws (N, levels) of what the bands say of them."""

    true: Array
    draws: Array

    @property
    def inside(self) -> Array:
        """Whether the 90 % bands hold them."""
        low, high = np.quantile(self.draws, [0.05, 0.95], axis=0)
        return (low <= self.true) & (self.true <= high)


def far_off(seed: int, folder: Path) -> tuple[Specimen, Curve]:
    """A recording, and its true friction-free force (N) at pressures (kPa) and contractions."""
    write_calibration_case(seed, folder / "fitted", folder / "held_out")
    specimen, muscle = read(folder / "fitted"), hyperelastic_muscle(seed)
    rng = np.random.default_rng([seed, 9])
    top = specimen.levels_Pa[-1] / 1e3
    pull, dead, offset, scale = (
        rng.uniform(0.8, 1.0), rng.uniform(0.0, 0.06) * top, rng.uniform(0.0, 0.02), rng.uniform(0.95, 1.05)
    )  # fmt: skip

    def force(pressure: Array, contraction: Array) -> Array:
        return pull * muscle.force(np.maximum(pressure - dead, 0.0), scale * contraction + offset)

    loops = specimen.loops
    assert loops is not None
    places = loops.pressure_Pa / 1e3, loops.displacement_m * 1e3 / muscle.geometry.L0_mm
    reading = loops.force_N + force(*places) - muscle.force(*places)
    return replace(specimen, loops=replace(loops, force_N=reading)), force


def blocked_forces(seed: int, folder: Path, *, remainder: bool = True) -> AtFullLength:
    """Calibrate one of them as ``calibrate`` does by default."""
    specimen, true = far_off(seed, folder)
    model, draws = posterior_draws(specimen, specimen, Options(remainder=remainder), seed, exact=False)
    zero = np.zeros(len(specimen.levels_Pa))
    force = predict_force(model, draws.values, draws.eta, Readings.at_rest(specimen.levels_Pa, zero, zero))
    if remainder:
        # As in the bands, the mean of both branches of a new stroke.
        own = np.random.default_rng([seed, 3]).standard_normal(force.shape) / np.sqrt(2.0)
        force = force + draws.values["stroke_remainder_sd_N"] * own
    return AtFullLength(true(specimen.levels_Pa / 1e3, zero), force)
