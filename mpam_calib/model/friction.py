"""The declared friction as part of the chain: one factor, or one for each level."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.catalogue.coulomb_friction import k_f
from mpam_calib.model.catalogue.strand_friction import f_s
from mpam_calib.model.effect import Values
from mpam_calib.model.priors import Parameter
from mpam_calib.model.readings import Readings
from mpam_calib.model.state import Setting, State
from mpam_calib.specimen.declaration import Simulation
from mpam_calib.units import level_labels

Array = NDArray[np.float64]

FRICTIONS = {"coulomb_friction", "strand_friction"}
"""Effects that are a friction."""


def rubs(simulation: Simulation) -> bool:
    """Whether a simulation has any friction, declared as such or among its effects."""
    return simulation.friction != "none" or bool(FRICTIONS & set(simulation.effect_ids))


@dataclass(frozen=True)
class DeclaredFriction:
    """Coulomb (Eq. 2.44), strand (Eq. 2.43) or no friction, as ``[simulation]`` declares it."""

    setting: Setting

    @cached_property
    def names(self) -> list[str]:
        """Names of the sampled factors, one or one for each level."""
        simulation = self.setting.simulation
        if simulation.friction == "none":
            return []
        stem = "K_f" if simulation.friction == "coulomb" else "f_s"
        if not simulation.friction_by_pressure:
            return [stem]
        return [f"{stem}@{label}" for label in level_labels(self.setting.levels)]

    @property
    def by_level(self) -> int:
        """How many of the factors act at one level each: all, where there is more than one."""
        names = self.names
        return len(names) if len(names) > 1 else 0

    def parameters(self) -> tuple[Parameter, ...]:
        """The factors' priors."""
        make = k_f if self.setting.simulation.friction == "coulomb" else f_s
        return tuple(make(name) for name in self.names)

    def apply(self, state: State, values: Values) -> State:
        """Add the declared friction to the state."""
        names = self.names
        if not names:
            return state
        if len(names) == 1:
            factor = values[names[0]]
        else:
            factor = self._at(state.readings, np.concatenate([values[name] for name in names], axis=1))
        if self.setting.simulation.friction == "coulomb":
            return state._replace(coulomb=state.coulomb + factor)
        return state._replace(strand=state.strand + factor)

    def as_others_say(self, values: Values, level: int) -> dict[str, Array]:
        """Values (B, 1) in which one level's own factor is what its neighbours' come to at its pressure.

        So is that of a pressure between levels; beyond them it is the nearest level's.
        """
        if not self.by_level:
            return dict(values)
        levels, others = self.setting.levels, np.delete(np.arange(self.by_level), level)
        weights = [float(np.interp(levels[level], levels[others], one)) for one in np.eye(len(others))]
        said = sum(w * values[self.names[i]] for w, i in zip(weights, others, strict=True))
        return {**values, self.names[level]: np.asarray(said)}

    def _at(self, readings: Readings, factors: Array) -> Array:
        """The factors (B, levels) at the readings, (B, n): that of the own level, else interpolated."""
        known = readings.level >= 0
        if known.all():
            return np.asarray(factors[:, readings.level])
        eye = np.eye(len(self.setting.levels))
        weights = np.stack([np.interp(readings.pressure, self.setting.levels, row) for row in eye], axis=-1)
        weights[known] = eye[readings.level[known]]
        return np.asarray(factors @ weights.T)
