"""A calibrated muscle in the optimiser: blocked force and free contraction of a design for every draw.

The force is the calibrated model's own, with all its effects, at another geometry: what was fitted at
one R, t and α is carried to others. That is an extrapolation, and whoever reports a design must say so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mpam_calib.design.problem import E_BR, Function
from mpam_calib.model.chain import Chain
from mpam_calib.model.effect import effect
from mpam_calib.model.model import Model
from mpam_calib.model.readings import Readings
from mpam_calib.model.remainder import SMOOTH
from mpam_calib.model.state import Setting
from mpam_calib.posterior.draws import Draws
from mpam_calib.prediction.beyond import Beyond
from mpam_calib.prediction.curves import GRID, first_root
from mpam_calib.prediction.free_moduli import moduli_change
from mpam_calib.specimen.declaration import Braid
from mpam_calib.units import DEG, GPA, MM, si_factor

Array = NDArray[np.float64]

STRANDS = "braid_stretch"
"""The effect whose term (Eq. 2.25) is the braid's in Eq. 3.12."""
STRANDS_FACTOR = "braid_factor"
LEAST_SHARE = 1e-6
"""Share of the remainder below which a design is taken to have none."""
STEEPEST, FLATTEST = 89.0 * DEG, 1.0 * DEG
"""No tolerance turns a strand beyond these."""


@dataclass(frozen=True)
class MuscleDraws:
    """A model with N draws of its posterior and of the tolerances to which a new muscle is built.

    ``tolerance``: SI deviations (N, 1) from the drawing, by the names of the geometry's values. What
    the run found of its own specimen's geometry, or of its rig, is not carried over; a gauge's offset is,
    as pressures are those that the gauge reads. ``beyond``: what is not known of pressures that
    were not recorded.
    """

    model: Model
    draws: Draws
    tolerance: dict[str, Array]
    beyond: Beyond | None

    @classmethod
    def prepare(cls, model: Model, draws: Draws, count: int, seed: int) -> MuscleDraws:
        """At most ``count`` draws; the tolerances are the declared sds, stratified normal deviates."""
        assert model.setting is not None
        few = draws.thin(count)
        rng = np.random.default_rng([seed, 9])
        sds = model.setting.geometry.sd.model_dump()
        tolerance = {
            name: float(sd) * si_factor(name) * _deviates(len(few), rng)[:, None] for name, sd in sds.items()
        }
        return cls(model, few, tolerance, Beyond.draw(model, few, seed))

    @property
    def _setting(self) -> Setting:
        assert self.model.setting is not None
        return self.model.setting

    def __len__(self) -> int:
        return len(self.draws)

    def blocked_forces(self, P: float, x: Array) -> Array:
        """Friction-free force at rest length (N) of designs x (..., 3 or 5) at P (Pa); (..., N)."""
        flat = np.asarray(x, dtype=np.float64).reshape(-1, np.shape(x)[-1])
        zero = np.zeros(len(flat))
        force = self._force(flat, Readings.at_rest(zero + P, zero))
        return force.T.reshape(*np.shape(x)[:-1], len(self))

    def curves(self, P: float, x: Array, gamma: Array) -> Array:
        """Friction-free force (N) of one design x (3 or 5,) at P (Pa) and contractions γ; (N, γ)."""
        readings = Readings.at_rest(np.asarray(P), self._setting.geometry.L0 * gamma)
        return self._force(np.asarray(x)[None, :], readings)

    def free_contractions(self, P: float, x: Array) -> Array:
        """First root of the friction-free force of one design, (N,).

        0 where F(0) <= 0, the grid's end (``LIMIT``) where there is none before it.
        """
        return first_root(GRID, self.curves(P, x, GRID))

    def _force(self, x: Array, readings: Readings) -> Array:
        """Force (N, n) of designs (n or 1, 3 or 5) at readings (n,), the smooth remainder included."""
        chain, values = self._chain(x), self._values(x)
        p, q, _ = self.model.linear_sizes
        eta = self.draws.eta[:, :p]
        force = chain.force(values, eta, readings)
        if self.model.remainder is not None:
            left = self.draws.eta[:, p : p + q] @ self.model.remainder.columns(readings).T
            left, share = self.draws.values[SMOOTH] * left, self._share(x)
            if self.beyond is not None:
                # What the remainder comes to is a force of the tested muscle's size.
                size = np.maximum(share, LEAST_SHARE)
                change = moduli_change(chain, values, eta, readings, self.beyond.unknown)
                moduli = None if change is None else change / size
                left = left + self.beyond.force(readings, force / size + left, moduli)
            force = force + left * share
        return force

    def _chain(self, x: Array) -> Chain:
        """The model's chain; with five variables the strands are the design's, and they stretch.

        The moduli's block stays the run's own: its coordinates mean coefficients at the geometry of
        the tested muscle.
        """
        setting = self._setting
        effects = tuple(e for e in setting.simulation.effects if not effect(e).of_test)
        if x.shape[-1] == 5:
            # One value for each design: the effects broadcast, which a declared braid need not.
            strands = {"R_br_mm": x[:, 3] / MM, "n": x[:, 4]}
            setting = replace(setting, braid=self._braid().model_copy(update=strands))
            if not self._has_strands:
                effects = (*effects, STRANDS)
        simulation = setting.simulation.model_copy(update={"effects": effects})
        return Chain(replace(setting, simulation=simulation), self.model.moduli)

    @property
    def _has_strands(self) -> bool:
        return any(e.partition(":")[0] == STRANDS for e in self._setting.simulation.effects)

    def _braid(self) -> Braid:
        """The declared braid; without one, strands as stiff as in chapter 3."""
        return self._setting.braid or Braid(E_br_GPa=E_BR / GPA, nu_s=0.33, R_br_mm=0.11, n=48)

    def _values(self, x: Array) -> dict[str, Array]:
        """The draws' values with the designs' geometry, deviations included, as (N, n) arrays."""
        drawn = {
            "L0_mm": np.full(len(x), self._setting.geometry.L0),
            "R0_mm": x[:, 0],
            "t0_mm": x[:, 1],
            "alpha0_deg": x[:, 2],
        }
        built = {name: drawing[None, :] + self.tolerance[name] for name, drawing in drawn.items()}
        built["alpha0_deg"] = np.clip(built["alpha0_deg"], FLATTEST, STEEPEST)
        for name in ("L0_mm", "R0_mm", "t0_mm"):
            built[name] = np.maximum(built[name], 0.01 * drawn[name])
        values = {**self.draws.values, **built}
        if x.shape[-1] == 5 and not self._has_strands:
            values[STRANDS_FACTOR] = np.ones((len(self), 1))
        return values

    def _share(self, x: Array) -> Array:
        """Ideal gas force at rest length over that of the tested muscle, (n,): the remainder's scale."""
        own = self._setting.geometry
        ideal = x[:, 0] ** 2 * (2.0 * np.tan(x[:, 2]) ** 2 - 1.0)
        tested = own.R0**2 * (2.0 * np.tan(own.alpha0) ** 2 - 1.0)
        share: Array = np.maximum(ideal / tested, 0.0) if tested > 0.0 else np.ones(len(x))
        return share


def _deviates(count: int, rng: np.random.Generator) -> Array:
    """Standard normal deviates (count,), one from the middle of each of as many equal strata, shuffled."""
    from scipy.special import ndtri

    deviates: Array = ndtri((rng.permutation(count) + 0.5) / count)
    return deviates


def mean_force(muscle: MuscleDraws, P: float) -> Function:
    """The posterior mean of the blocked force at P (Pa) as an objective (N)."""
    return lambda x: np.asarray(muscle.blocked_forces(P, x).mean(axis=-1))


def quantile_force(muscle: MuscleDraws, P: float) -> Function:
    """The 5 % quantile of the blocked force at P (Pa) as an objective (N): what can be relied on."""
    return lambda x: np.asarray(np.quantile(muscle.blocked_forces(P, x), 0.05, axis=-1))
