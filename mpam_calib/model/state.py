"""What passes along the chain: one immutable record that each stage hands on, changed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.readings import Readings
from mpam_calib.physics.kinematics import Rest, Shape
from mpam_calib.specimen.declaration import Braid, Geometry, Simulation
from mpam_calib.units import MINUTE, MM

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """What is fixed while parameters vary: the declaration and the scales that priors refer to.

    ``levels`` (Pa) are the specimen's pressure levels; ``stroke`` (m) its largest recorded
    displacement; ``force_scale`` (N) the root mean square of the declared gas force over the
    reference grid. ``force_sd`` (N) is the declared sensor noise, if any.
    """

    simulation: Simulation
    geometry: Geometry
    braid: Braid | None
    levels: Array
    stroke: float
    force_scale: float
    force_sd: float | None
    pressure_bias_sd: float = 0.0
    nuisances: bool = True
    """Whether declared uncertainties are sampled."""
    pulls_at: float = np.inf
    """The lowest pressure (Pa) at which the recordings show the muscle pulling."""
    duration: float = 0.0
    """Length of the whole test, s."""
    level_time: float = 0.0
    """Longest time spent at one level, s."""
    speed: float = 50.0 * MM / MINUTE
    """Geometric mean of the strokes' speeds, m/s; without loops the thesis's."""
    strokes: Array | None = None
    """Largest recorded displacement at each level, m; None where they are not told apart."""

    @property
    def top_pressure(self) -> float:
        """The highest level, Pa."""
        return float(self.levels[-1])


class State(NamedTuple):
    """Arrays of shape (B, n) or broadcastable to it: B parameter vectors, n readings.

    rig: ``pressure`` (Pa) and ``displacement`` (m) that the muscle really sees.
    shape: ``rest``, ``kinematics``, ``swell`` (factor on the radius's growth), the working ``length`` (m)
    and, once solved, the ``shape``.
    statics: ``wall_factor`` on the thickness term, ``lost`` (N) to be subtracted.
    friction: ``sign`` s (fractions while it turns over), ``coulomb`` K and ``strand`` f_s, both times
    ``friction_gain``, ``tightening``, the share of the force that friction adds whichever way the muscle
    goes, and ``drag`` (N), the same at any force and pressure.
    history: ``wall_gain`` on the bladder's stress and ``gain`` on the whole force.
    sensor: ``zero`` (N), added to the reading.
    """

    readings: Readings
    guide: Array
    pressure: Array
    displacement: Array
    rest: Rest
    kinematics: str
    swell: Array
    length: Array
    shape: Shape | None
    wall_factor: Array
    lost: Array
    sign: Array
    coulomb: Array
    tightening: Array
    strand: Array
    drag: Array
    friction_gain: Array
    wall_gain: Array
    gain: Array
    zero: Array
