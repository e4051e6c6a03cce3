"""Bands at levels left out where no simulation in the package is true: another wall, another friction.

The test rig's muscles have a hyperelastic wall and a seal-like friction (:mod:`rig.calibration`). They are
calibrated as ``calibrate`` does by default, with a polynomial wall, Coulomb friction and the remainder.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from model import build
from rig.calibration import hyperelastic_muscle, write_calibration_case

from mpam_calib.model.blueprint import Options
from mpam_calib.specimen import read

from .coverage import HeldOut, inside_bands, posterior_draws


def held_out_levels(seed: int, folder: Path, options: Options, narrow: float = 1.0) -> list[HeldOut]:
    """Calibrate on four levels of a muscle and look at the three between them.

    ``narrow`` shrinks the predictive draws towards their mean (for a test that must fail).
    """
    write_calibration_case(seed, folder / "fitted", folder / "held_out")
    fitted, held = read(folder / "fitted"), read(folder / "held_out")
    model, draws = posterior_draws(fitted, fitted, options, seed, exact=False)
    rng = np.random.default_rng([seed, 2])
    loops, muscle = held.loops, hyperelastic_muscle(seed)
    assert loops is not None
    places = build.rows_of(loops)
    places = replace(places, level=np.full(len(places), -1))
    pressure, contraction = loops.pressure_Pa / 1e3, loops.displacement_m * 1e3 / muscle.geometry.L0_mm
    true = muscle.force(pressure, contraction) + loops.branch * muscle.friction(pressure, contraction)
    found = []
    for level in np.unique(loops.level):
        mask = loops.level == level
        here = loops.force_N[mask], true[mask]
        found.append(inside_bands(model, draws, places.take(mask), *here, rng, narrow))
    return found
