"""What the declared simulation leaves free: friction value(s) and the moduli, as a vector of numbers.

Moduli from a tensile test: one common relative error with its declared sd. Free moduli: an orthonormal basis
of the wall's force over the rows, one unit of each being `noise` N rms: cancelling constants stay tame.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from .chain import force_of
from .muscle import Array, Law, Muscle
from .protocol import Rows


@dataclass(frozen=True)
class Nuisance:
    """Free numbers around `muscle` (tensile moduli as declared): prior `sd` and difference `step` of each."""

    muscle: Muscle
    basis: Array
    sd: Array
    step: Array

    @property
    def count(self) -> int:
        return int(self.sd.size)

    def apply(self, values: Array) -> Muscle:
        """The muscle with the free numbers set (all 0: the muscle itself)."""
        sim = self.muscle.simulation
        frictions = len(sim.friction_value) if sim.friction != "none" else 0
        friction = (
            tuple(float(v + d) for v, d in zip(sim.friction_value, values[:frictions], strict=True))
            if frictions
            else sim.friction_value
        )
        rest = values[frictions:]
        if sim.source == "tensile":
            factor = 1.0 + float(rest[0])
            law = replace(sim.law, constants=_rows(factor * _flat(sim.law), sim.law))
            return self.muscle.with_simulation(friction_value=friction, law=law)
        moved = _flat(sim.law) + self.basis @ rest[: self.basis.shape[1]]
        rates = sim.law.rates
        if sim.law.name == "exponential":
            rates = (rates[0] * float(np.exp(rest[-2])), rates[1] * float(np.exp(rest[-1])))
        law = replace(sim.law, constants=_rows(moved, sim.law), rates=rates)
        return self.muscle.with_simulation(friction_value=friction, law=law)


def _flat(law: Law) -> Array:
    return np.array([c for row in law.constants for c in row])


def _rows(flat: Array, law: Law) -> tuple[tuple[float, ...], ...]:
    width = len(law.constants[0])
    return tuple(tuple(float(c) for c in flat[k * width : (k + 1) * width]) for k in range(law.order))


def nuisance_of(muscle: Muscle, rows: Rows, noise_N: float) -> Nuisance:
    """The free numbers of the declared simulation around the given muscle."""
    sim = muscle.simulation
    frictions = len(sim.friction_value) if sim.friction != "none" else 0
    small, wide = (0.005, 0.5) if sim.friction == "coulomb" else (0.05, 5.0)
    sd, step = [wide] * frictions, [small] * frictions
    if sim.source == "tensile":
        law = replace(sim.law, constants=tuple((e,) for e in sim.declared_E_Pa))
        muscle = muscle.with_simulation(law=law)
        return Nuisance(muscle, np.zeros((0, 0)), np.array([*sd, sim.E_rel_sd]), np.array([*step, 0.02]))
    flat = _flat(sim.law)
    bare = muscle.with_simulation(friction="none")
    zero = force_of(bare.with_simulation(law=replace(sim.law, constants=_rows(0 * flat, sim.law))), rows)
    columns = np.empty((rows.count, flat.size))
    for j in range(flat.size):
        one = np.zeros(flat.size)
        one[j] = max(float(np.abs(flat).max()), 1.0)
        law = replace(sim.law, constants=_rows(one, sim.law))
        columns[:, j] = (force_of(bare.with_simulation(law=law), rows) - zero) / one[j]
    norms = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    _, s, vt = np.linalg.svd(columns / norms, full_matrices=False)
    kept = s > 1e-9 * s[0]
    basis = (vt[kept].T / s[kept]) / norms[:, None] * noise_N * np.sqrt(rows.count)
    sd += [1e4] * int(kept.sum())
    step += [1.0] * int(kept.sum())
    if sim.law.name == "exponential":
        sd += [0.5, 0.5]
        step += [0.05, 0.05]
    return Nuisance(muscle, basis, np.array(sd), np.array(step))


def differences(nuisance: Nuisance, at: Array, force: Array, model: Callable[[Muscle], Array]) -> Array:
    """Forward differences (rows, count) of `model(muscle)` in the free numbers."""
    out = np.empty((force.size, nuisance.count))
    for j in range(nuisance.count):
        moved = at.copy()
        moved[j] += nuisance.step[j]
        out[:, j] = (model(nuisance.apply(moved)) - force) / nuisance.step[j]
    return out


def left_over(change: Array, columns: Array, nuisance: Nuisance, noise_N: float) -> Array:
    """What the free numbers (with their priors) cannot take up of a change of force [N]."""
    scaled = columns * nuisance.sd / noise_N
    normal = scaled.T @ scaled + np.eye(nuisance.count)
    return change - noise_N * (scaled @ np.linalg.solve(normal, scaled.T @ (change / noise_N)))
