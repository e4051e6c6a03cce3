"""The posterior that all samplers draw from: the thesis's model on synthetic loops with white noise.

Eight moduli (linear law of order 4), a dead-band, one friction factor and the noise. With |F| = F the
force is F = (1 + K s)·((P − P_DB) g + X η), where g is the gas's and the wall's force per pressure and X the
moduli's columns, in the basis whose prior is N(0, I) in newtons on the reference grid.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.model.catalogue.coulomb_friction import SCALE
from mpam_calib.model.catalogue.dead_band import OWN_SD
from mpam_calib.model.model import build_model
from mpam_calib.posterior.density.target import predict_force
from mpam_calib.posterior.likelihood.row_motion import row_readings
from mpam_calib.specimen.declaration import Braid, Csv, Fit, Geometry, Sensors, Simulation
from mpam_calib.specimen.recording import Loops, Specimen

from .rows import Rows

Array = NDArray[np.float64]

WHITE_ONLY = Options(correlated_noise=False, remainder=False, nuisances=False)
FULL = Options()
LEVELS_KPA = np.array([50.0, 100.0, 150.0, 200.0, 250.0])
DURATION = 18.0
"""Seconds of a stroke: 1,800 rows at 100 Hz."""
SHARE = 0.9
"""Share of the free contraction at which a stroke ends, so that every force pulls."""
NAMES = (*(f"{letter}_{k}" for letter in "ab" for k in range(1, 5)), "P_DB_kPa", "K_f", "noise_sd_N")
TRUTH = {"P_DB_kPa": 8e3, "K_f": 0.08, "noise_sd_N": 0.25}
CORRELATED_SD, CORRELATED_TIME = 0.15, 0.1
"""Newtons and seconds of the correlated part, where it is asked for."""
ETA = 0.1 * np.array([1.0, -0.5, 0.3, 0.2, -0.4, 0.6, -0.2, 0.1])


def _loops(contraction: Array, L0: float, rows: int, cycles: int) -> Loops:
    """At each level ``cycles`` strokes out and back of ``rows`` readings each."""
    strokes = len(LEVELS_KPA) * cycles * 2
    level = np.repeat(np.arange(len(LEVELS_KPA)), cycles * 2)
    branch = np.tile([-1, 1], strokes // 2)
    way = (np.arange(rows) + 0.5) / rows
    path = np.where(branch[:, None] < 0, way, way[::-1]) * contraction[level][:, None] * L0
    n = strokes * rows
    return Loops(
        time_s=np.arange(n) * DURATION / rows,
        pressure_Pa=np.repeat(LEVELS_KPA[level] * 1e3, rows),
        displacement_m=path.ravel(),
        force_N=np.full(n, 10.0),
        level=np.repeat(level, rows),
        cycle=np.repeat(np.arange(strokes) // 2 % cycles + 1, rows),
        branch=np.repeat(branch, rows),
        stroke=np.repeat(np.arange(strokes), rows),
        clock=np.zeros(n, dtype=np.int64),
        censored=np.zeros(n, dtype=bool),
    )


def specimen(rows: int = 1800, cycles: int = 1, correlated: bool = False, seed: int = 1) -> Specimen:
    """A muscle like MPAM1 with 10·cycles strokes of ``rows`` readings."""
    geometry = Geometry(L0_mm=50.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=72.0)
    reach = SHARE * np.array([0.16, 0.22, 0.25, 0.27, 0.28])
    loops = _loops(reach, geometry.L0, rows, cycles)
    made = Specimen(
        name="benchmark",
        bladder_material="",
        folder=Path(),
        geometry=geometry,
        braid=Braid(E_br_GPa=2.1, nu_s=0.33, R_br_mm=0.11, n=48),
        sensors=Sensors(force_sd_N=0.25),
        simulation=Simulation(
            kinematics="constant_thickness",
            strain="stretch",
            friction="coulomb",
            effects=("dead_band",),
            order=4,
            law="linear",
        ),
        fit=Fit(),
        csv=Csv(),
        levels_Pa=LEVELS_KPA * 1e3,
        loops=loops,
        force_map=None,
        blocked_force=None,
        free_contraction=None,
        tensile=None,
        digest="benchmark",
    )
    model = build_model(draw_blueprint(made, WHITE_ONLY))
    values = {name: np.array([[TRUTH[name]]]) for name in model.names}
    force = predict_force(model, values, ETA[None], row_readings(loops))[0]
    rng = np.random.default_rng(seed)
    force += TRUTH["noise_sd_N"] * rng.standard_normal(len(force))
    if correlated:
        rho = np.exp(-DURATION / rows / CORRELATED_TIME)
        shocks = CORRELATED_SD * np.sqrt(1.0 - rho**2) * rng.standard_normal(len(force))
        force += lfilter([1.0], [1.0, -rho], shocks)
    return replace(made, loops=replace(loops, force_N=force))


def as_rows(made: Specimen) -> Rows:
    """What a user would hand to another sampler."""
    blueprint = draw_blueprint(made, WHITE_ONLY)
    model = build_model(blueprint)
    loops = made.loops
    assert loops is not None and model.chain is not None and model.moduli is not None
    plain = {"K_f": np.zeros((1, 1)), "P_DB_kPa": np.zeros((1, 1)), "noise_sd_N": np.ones((1, 1))}
    terms = model.chain.terms(plain, row_readings(loops))
    X, g = terms.columns[0], terms.fixed[0] / loops.pressure_Pa
    slope = 1.0 + TRUTH["K_f"] * loops.branch
    A = slope[:, None] * X / TRUTH["noise_sd_N"]
    covariance = np.linalg.inv(np.eye(X.shape[1]) + A.T @ A)
    gas = np.stack([loops.force_N - slope * loops.pressure_Pa * g, slope * g], axis=1) / TRUTH["noise_sd_N"]
    centre, shift = (covariance @ (A.T @ gas)).T
    transform = model.moduli.transform(plain)[1][0]
    units = np.array([size for _, size in model.moduli.law.coefficient_units()])
    return Rows(
        force=loops.force_N,
        pressure=loops.pressure_Pa,
        sign=loops.branch.astype(np.float64),
        per_pressure=g,
        columns=X,
        centre=centre,
        shift=shift,
        root=np.linalg.cholesky(covariance),
        transform=transform / units[:, None],
        dead_band_sd=OWN_SD * made.levels_Pa[-1],
        pulls_at=blueprint.pulls_at,
        friction_scale=SCALE,
        noise_prior=(made.sensors.force_sd_N or 0.0, 0.7),
    )
