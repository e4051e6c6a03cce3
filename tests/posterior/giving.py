"""A large muscle (2.3 kN) on a fixture that gives: its true force, and readings of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from model import build

from mpam_calib.model.blueprint import Blueprint, Options, draw_blueprint
from mpam_calib.model.model import Model
from mpam_calib.posterior.density.target import build_target, predict_force
from mpam_calib.specimen.declaration import Geometry, Noise, Sensors
from mpam_calib.specimen.recording import Specimen

Array = np.ndarray
GEOMETRY = Geometry(L0_mm=200.0, R0_mm=10.0, t0_mm=1.5, alpha0_deg=72.0)
NOISE = 2.0
COMPLIANCE = 1e-5
"""m/N: at full force the fixture gives a tenth of the length."""


@dataclass(frozen=True)
class Giving:
    """A specimen and the truth behind it: values (1, 1) by name, η (1, k), the rows' force (n,), N."""

    specimen: Specimen
    blueprint: Blueprint
    model: Model
    values: dict[str, Array]
    eta: Array
    force: Array


def giving(
    effects: tuple[str, ...] = ("rig_compliance",),
    options: Options = build.PLAIN,
    noise: float = NOISE,
    rows: int = 40,
    friction: str = "coulomb",
    noise_law: Noise | None = None,
) -> Giving:
    """Three levels of one cycle, white noise (N); what is not named is at its prior's centre."""
    declared = {"law": "linear", "order": 2, "effects": list(effects), "friction": friction}
    recorded = build.loops((200.0, 400.0, 600.0), 45.0, rows)
    sensors = Sensors(force_sd_N=NOISE)
    made = build.specimen(declared, recorded, geometry=GEOMETRY, sensors=sensors, noise=noise_law or Noise())
    made = build.with_force(made, np.full(len(recorded.time_s), 20.0))
    blueprint = draw_blueprint(made, options)
    model = build_target(made, blueprint).model
    truth = {"K_f": 0.06, "compliance_mm_per_N": COMPLIANCE, "noise_sd_N": NOISE}
    values = model.values(np.zeros((1, len(model.names))))
    values |= {name: np.array([[x]]) for name, x in truth.items() if name in values}
    rng = np.random.default_rng(0)
    eta = np.zeros((1, sum(model.linear_sizes)))
    eta[:, : model.linear_sizes[0]] = 0.2 * rng.standard_normal(model.linear_sizes[0])
    force = predict_force(model, values, eta, build.rows_of(recorded))[0]
    made = build.with_force(made, force + noise * rng.standard_normal(len(force)))
    return Giving(made, blueprint, model, values, eta, force)
