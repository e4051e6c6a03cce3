"""How much a material's moduli depend on the strain range that they are fitted to."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from mpam_calib.model.model import Model
from mpam_calib.model.reference import rest_of
from mpam_calib.physics.kinematics import shape_inextensible_braid
from mpam_calib.physics.statics import gas_force, modulus_columns, thickness_force
from mpam_calib.posterior.density.target import build_target, locate
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.curves import first_root
from mpam_calib.specimen.declaration import Geometry
from mpam_calib.specimen.recording import Specimen
from mpam_calib.units import KPA

Array = NDArray[np.float64]

MUSCLE = Geometry(L0_mm=50.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=72.0)
"""The thesis's muscle, as an example of what the moduli lead to."""
PRESSURE = 200.0 * KPA
CONTRACTION = 0.1
DRAWS = 500
MINIMUM = 20
"""Fewer readings in a range say too little to fit it."""


def strain_range_table(specimen: Specimen, model: Model, draws: Draws, seed: int) -> pd.DataFrame:
    """Moduli and what they predict for an MPAM1-shaped muscle, for four strain ranges.

    The declared range, its lower half and lower quarter, and all of the test. Laplace's approximation
    around each range's own mode; the declared range is the posterior that was sampled.
    """
    assert model.tensile is not None and specimen.tensile is not None and model.moduli is not None
    low, high = model.tensile.low, model.tensile.high
    span = high - low
    whole = (max(float(specimen.tensile.strain.min()), 0.0), float(specimen.tensile.strain.max()))
    ranges = [(low, high), (low, low + span / 2), (low, low + span / 4), whole]
    rows = []
    for number, (first, last) in enumerate(dict.fromkeys(ranges)):
        inside = (specimen.tensile.strain >= first) & (specimen.tensile.strain <= last)
        if inside.sum() < MINIMUM:
            continue
        if number == 0:
            drawn = draws.thin(DRAWS)
            moduli = model.moduli.coefficients(drawn.eta[:, : model.moduli.size], drawn.values)
        else:
            moduli = _laplace_moduli(specimen, model, first, last, seed)
        for name, unit, values in _quantities(moduli, model.tensile.convention):
            q05, q95 = np.quantile(values, [0.05, 0.95])
            rows.append([first, last, number == 0, name, unit, values.mean(), q05, q95])
    columns = ["strain_low", "strain_high", "used", "quantity", "unit", "mean", "q05", "q95"]
    return pd.DataFrame(rows, columns=columns)


def _laplace_moduli(specimen: Specimen, model: Model, low: float, high: float, seed: int) -> Array:
    rng = np.random.default_rng([seed, 7])
    blueprint = model.blueprint.model_copy(update={"tensile_range": (low, high)})
    target, modes = locate(build_target(specimen, blueprint), rng)
    u = rng.multivariate_normal(modes[0].u, modes[0].covariance, DRAWS)
    values = target.model.values(u)
    eta = target.linear_draws(values, rng)
    assert target.model.moduli is not None
    return target.model.moduli.coefficients(eta[:, : target.model.moduli.size], values)


def _quantities(moduli: Array, convention: str) -> list[tuple[str, str, Array]]:
    """Moduli (Pa), and force at 10 % and free contraction of the example muscle at 200 kPa."""
    grid = np.linspace(0.0, 0.45, 181)
    rest = rest_of(MUSCLE)
    shape = shape_inextensible_braid(MUSCLE.L0 * (1.0 - grid)[None, :], rest)
    columns = modulus_columns(shape, rest, convention, moduli.shape[1])[0]
    force = (
        gas_force(np.array(PRESSURE), shape) + thickness_force(np.array(PRESSURE), shape) + moduli @ columns.T
    )
    at = int(np.argmin(np.abs(grid - CONTRACTION)))
    found = [(f"E_{k + 1}", "Pa", moduli[:, k]) for k in range(moduli.shape[1])]
    found.append(("force at 10 % of an MPAM1-shaped muscle, 200 kPa", "N", force[:, at]))
    found.append(("its free contraction", "", first_root(grid, force)))
    return found
