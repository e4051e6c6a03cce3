"""Loops and maps whose noise grows, or comes in bursts; and what a fit by Laplace's draws makes of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from model import build

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.posterior.density.collapsed import Collapsed
from mpam_calib.posterior.density.mode import Mode
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.specimen.declaration import Noise
from mpam_calib.specimen.recording import Specimen

Array = np.ndarray
SD, K_F = 0.2, 0.06


def loops_with(noise: Noise, bursts: int = 0, growth: float = 0.0, seed: int = 0, rows: int = 200) -> tuple[
    Specimen, Array
]:  # fmt: skip
    """Three levels, two cycles of 2 × ``rows`` at 100 Hz, and the true force of every row.

    A burst shifts up to fifteen readings together by 2 to 20 N (noise: 0.2 N), mostly upwards.
    """
    rng = np.random.default_rng(seed)
    recorded = build.loops((100.0, 150.0, 200.0), 12.0, rows, cycles=2, dt=0.01)
    made = build.specimen({"law": "linear", "order": 2}, recorded, noise=noise)
    made = build.with_force(made, np.full(len(recorded.time_s), 20.0))
    model = build_target(made, draw_blueprint(made, build.PLAIN)).model
    values = {"noise_sd_N": np.array([[SD]]), "K_f": np.array([[K_F]])}
    force = predict_force(model, values, 0.2 * rng.standard_normal((1, 4)), build.rows_of(recorded))[0]
    assert model.setting is not None
    sd = SD * np.sqrt(1.0 + (growth * force / model.setting.force_scale) ** 2)
    reading = force + sd * rng.standard_normal(len(force))
    for start in rng.choice(len(force) - 15, bursts, replace=False):
        reading[start : start + rng.integers(1, 15)] += rng.choice([1.0, 1.0, -1.0]) * rng.uniform(2.0, 20.0)
    return build.with_force(made, reading), force


@dataclass(frozen=True)
class Fitted:
    """A mode, its target and draws around it: values name → (N, 1), force of every row (N, n)."""

    target: Collapsed
    mode: Mode
    values: dict[str, Array]
    force: Array

    def mean_sd(self, name: str) -> tuple[float, float]:
        return float(self.values[name].mean()), float(self.values[name].std())


def fitted(made: Specimen, options: Options, draws: int = 200) -> Fitted:
    target, modes = locate(build_target(made, draw_blueprint(made, options)), np.random.default_rng(0))
    rng = np.random.default_rng(1)
    d = len(modes[0].u)
    u = modes[0].u + rng.standard_normal((draws, d)) @ np.linalg.cholesky(modes[0].covariance).T
    values = target.model.values(u)
    eta = target.linear_draws(values, rng)
    assert made.loops is not None
    rows = build.rows_of(made.loops)
    return Fitted(target, modes[0], values, predict_force(target.model, values, eta, rows))
