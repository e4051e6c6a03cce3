"""Bands at levels that were left out; muscles and data come from the test rig, in the model's forms."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from model import build
from rig.chain import force_of
from rig.muscle import Law, Muscle, static_force
from rig.protocol import Protocol, Rows, record_rows, sensor_noise
from rig.specimens import FAMILIES, loops_muscle, sensible, whole_levels

from mpam_calib.model.blueprint import Options, draw_blueprint
from mpam_calib.model.model import Model
from mpam_calib.model.readings import Readings
from mpam_calib.posterior.chains.proposal import StudentMixture
from mpam_calib.posterior.chains.sampling import sample
from mpam_calib.posterior.chains.weighing import laplace_mixture
from mpam_calib.posterior.density.mode import evaluate
from mpam_calib.posterior.density.target import build_target, locate, predict_force
from mpam_calib.posterior.draws import Draws, keep_draws
from mpam_calib.specimen.declaration import Braid, Geometry, Sensors
from mpam_calib.specimen.recording import Loops, Specimen

Array = np.ndarray
SHARES = (0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
LEFT_OUT = (1, 3, 5)
DRAWS, PROPOSED = 400, 3000


@dataclass(frozen=True)
class HeldOut:
    """One level that was left out: whether the 90 % band held each reading, and each true force."""

    readings: Array
    truth: Array


def rig_case(
    seed: int, shares: tuple[float, ...] = SHARES, other: Callable[[Law, float], Law] | None = None
) -> tuple[Muscle, Rows, Array, Array, Protocol]:
    """A random muscle with a linear law, its rows, the true force and the reading (N).

    ``shares`` are the levels over the highest pressure; ``other`` makes of the law and that (kPa) another.
    """
    rng = random.Random(f"coverage-{seed}")
    while True:
        family = FAMILIES[rng.choice(sorted(FAMILIES))]
        muscle, top = loops_muscle(family, rng, law="linear", order=rng.choice((1, 2, 3)))
        if other is not None:
            muscle = muscle.with_simulation(law=other(muscle.simulation.law, top))
        levels = whole_levels(shares, top)
        if sensible(muscle, levels):
            break
    blocked = float(static_force(muscle, top, 0.0)[0])
    protocol = Protocol(
        levels, cycles=1, rows_max=560, stroke_fraction=0.9, noise_N=0.004 * blocked,
        correlated_N=0.002 * blocked, correlation_s=0.15, pressure_noise_kPa=0.0,
    )  # fmt: skip
    rows = record_rows(protocol, muscle, seed)
    true = force_of(muscle, rows)
    return muscle, rows, true, true + sensor_noise(protocol, rows, seed), protocol


def as_specimen(muscle: Muscle, rows: Rows, reading: Array, protocol: Protocol) -> Specimen:
    """The rig's recording as the package reads one."""
    g, b = muscle.geometry, muscle.braid
    assert b is not None
    branch = rows.direction.astype(np.int64)
    stroke = np.cumsum(np.concatenate([[0], (np.diff(branch) != 0) | (np.diff(rows.level) != 0)]))
    n = rows.count
    loops = Loops(
        time_s=rows.time, pressure_Pa=rows.reading * 1e3, displacement_m=rows.displacement * 1e-3,
        force_N=reading, level=rows.level.astype(np.int64), cycle=rows.cycle.astype(np.int64), branch=branch,
        stroke=stroke.astype(np.int64), clock=np.zeros(n, dtype=np.int64), censored=np.zeros(n, dtype=bool),
    )  # fmt: skip
    sim = muscle.simulation
    return build.specimen(
        {"law": "linear", "order": sim.law.order, "friction": "coulomb"},
        loops,
        geometry=Geometry(L0_mm=g.L0_mm, R0_mm=g.R0_mm, t0_mm=g.t0_mm, alpha0_deg=float(g.alpha0_deg)),
        braid=Braid(E_br_GPa=b.E_br_GPa, nu_s=b.nu_s, R_br_mm=b.R_br_mm, n=b.n),
        sensors=Sensors(force_sd_N=float(np.hypot(protocol.noise_N, protocol.correlated_N))),
    )


def posterior_draws(fold: Specimen, whole: Specimen, options: Options, seed: int, exact: bool):
    """Draws by importance resampling from a Student-t at the mode, or by emcee.

    Laplace's Gaussian alone will not do: white and correlated noise trade along a bend, and a Gaussian
    across it makes the noise 10 % too large.
    """
    target, modes = locate(
        build_target(fold, draw_blueprint(whole, options)), np.random.default_rng([seed, 0])
    )
    if exact:
        return target.model, keep_draws(target, sample(target, modes, seed), seed).thin(2000)
    rng = np.random.default_rng([seed, 1])
    mixture = laplace_mixture(modes)
    proposed = mixture.draw(PROPOSED, np.random.RandomState(seed), widen=1.2)
    wide = StudentMixture(mixture.means, 1.2 * mixture.roots, mixture.shares)
    log_weight = evaluate(target, proposed) - wide.log_density(proposed)
    weight = np.exp(log_weight - log_weight.max())
    u = proposed[rng.choice(PROPOSED, DRAWS, p=weight / weight.sum())]
    values = target.model.values(u)
    eta = np.concatenate(
        [target.linear_draws({k: v[i : i + 50] for k, v in values.items()}, rng) for i in range(0, DRAWS, 50)]
    )
    return target.model, Draws(u, values, eta, 1)


def inside_bands(
    model: Model,
    draws: Draws,
    places: Readings,
    reading: Array,
    true: Array,
    rng: np.random.Generator,
    narrow: float = 1.0,
) -> HeldOut:
    """Whether readings and true forces (n,) lie in the 90 % bands that draws give at their places."""
    force = predict_force(model, draws.values, draws.eta, places)
    if "stroke_remainder_sd_N" in draws.values:
        force = force + draws.values["stroke_remainder_sd_N"] * rng.standard_normal(force.shape)
    noise = np.hypot(draws.values["noise_sd_N"], draws.values.get("noise_corr_sd_N", 0.0))
    seen = force + noise * rng.standard_normal(force.shape)
    inside = []
    for band, value in ((seen, reading), (force, true)):
        shrunk = band.mean(axis=0) + narrow * (band - band.mean(axis=0))
        low, high = np.quantile(shrunk, [0.05, 0.95], axis=0)
        inside.append((value >= low) & (value <= high))
    return HeldOut(*inside)


def held_out_levels(seed: int, options: Options, exact: bool = False, narrow: float = 1.0) -> list[HeldOut]:
    """Calibrate on every other level and look at those between.

    ``narrow`` shrinks the predictive draws towards their mean (for a test that must fail).
    """
    muscle, rows, true, reading, protocol = rig_case(seed)
    whole = as_specimen(muscle, rows, reading, protocol)
    kept = [j for j in range(len(SHARES)) if j not in LEFT_OUT]
    model, draws = posterior_draws(build.take_levels(whole, kept), whole, options, seed, exact)
    rng = np.random.default_rng([seed, 2])
    assert whole.loops is not None
    places = build.rows_of(whole.loops)
    found = []
    for level in LEFT_OUT:
        mask = whole.loops.level == level
        found.append(inside_bands(model, draws, places.take(mask), reading[mask], true[mask], rng, narrow))
    return found
