"""What the rig recorded, in SI units: one frozen dataclass for each kind of file."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpam_calib.specimen.declaration import Braid, Csv, Fit, Geometry, Noise, Sensors, Simulation

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LOADING, UNLOADING, NO_BRANCH = 1, -1, 0
PRESSURISING, DEPRESSURISING = 2, -2
"""Branch codes. Friction's sign s is the code where it is +1 or -1 and 0 otherwise."""

BRANCH_WORDS: dict[str, int] = {
    "loading": LOADING,
    "unloading": UNLOADING,
    "pressurising": PRESSURISING,
    "depressurising": DEPRESSURISING,
    "": NO_BRANCH,
}


@dataclass(frozen=True)
class Loops:
    """Force-displacement loops in time order; every array has shape (rows,).

    ``stroke`` numbers the contiguous runs of one file, level, cycle and branch, from 0; ``clock``
    numbers the files, each of which may have its own clock: ``time_s`` goes on from file to file, and such
    a clock began at ``began_s`` on it.
    ``averaged`` is how many consecutive rows of a very large file each entry stands for (1 otherwise), and
    ``noise_N`` the white noise of one of those rows (0 otherwise).
    ``unclear`` rows, at turns, tell of the motion, but their force may belong to the other branch.
    ``temperature_C`` is there only where every loops file has the column.
    """

    time_s: Floats
    pressure_Pa: Floats
    displacement_m: Floats
    force_N: Floats
    level: Ints
    cycle: Ints
    branch: Ints
    stroke: Ints
    clock: Ints
    censored: Bools
    began_s: Floats | float = 0.0
    averaged: int = 1
    noise_N: float = 0.0
    unclear: Bools | None = None
    temperature_C: Floats | None = None

    @property
    def strokes(self) -> tuple[Ints, Ints]:
        """First row and number of rows of each stroke."""
        first = np.flatnonzero(np.diff(self.stroke, prepend=self.stroke[0] - 1))
        return first, np.diff(np.append(first, len(self.stroke)))

    @property
    def clear(self) -> Loops:
        """The loops without their unclear rows."""
        return self if self.unclear is None else self.without(self.unclear)

    def without(self, rows: Bools) -> Loops:
        """The loops without some of their rows (rows,)."""
        if not rows.any():
            return self
        arrays: dict[str, Any] = {
            f.name: value[~rows]
            for f in fields(self)
            if isinstance(value := getattr(self, f.name), np.ndarray)
        }
        return replace(self, **arrays)


@dataclass(frozen=True)
class ForceMap:
    """Static force readings over pressure and contraction; arrays of shape (rows,)."""

    pressure_Pa: Floats
    contraction: Floats
    force_N: Floats
    level: Ints
    branch: Ints
    censored: Bools


@dataclass(frozen=True)
class BlockedForce:
    """Blocked force against pressure; arrays of shape (rows,)."""

    pressure_Pa: Floats
    force_N: Floats
    censored: Bools


@dataclass(frozen=True)
class FreeContraction:
    """Free contraction against pressure; arrays of shape (rows,)."""

    pressure_Pa: Floats
    contraction: Floats


@dataclass(frozen=True)
class Tensile:
    """Uniaxial tension of the bladder material (engineering strain and stress); shape (rows,)."""

    strain: Floats
    stress_Pa: Floats

    @property
    def strain_range(self) -> tuple[float, float]:
        """All its positive strains: from, to."""
        return max(float(self.strain.min()), 0.0), float(self.strain.max())


@dataclass(frozen=True)
class FileRead:
    """One data file as it was found: its kind, name, data rows, and how it is written."""

    kind: str
    name: str
    rows: int
    delimiter: str
    decimal: str


@dataclass(frozen=True)
class Specimen:
    """A specimen folder as read: what was declared and what was recorded.

    ``levels_Pa`` are the pressure levels (sorted, the median reading of each) that every
    ``level`` index of the recordings refers to; ``digest`` is a SHA-256 over the declaration
    and the bytes of every data file; ``declared_in`` is the file of the declaration, None of a specimen that
    was made in memory.
    """

    name: str
    bladder_material: str
    folder: Path
    geometry: Geometry | None
    braid: Braid | None
    sensors: Sensors
    simulation: Simulation
    fit: Fit
    csv: Csv
    levels_Pa: Floats
    loops: Loops | None
    force_map: ForceMap | None
    blocked_force: BlockedForce | None
    free_contraction: FreeContraction | None
    tensile: Tensile | None
    digest: str
    notes: tuple[str, ...] = ()
    files: tuple[FileRead, ...] = ()
    noise: Noise = field(default_factory=Noise)
    declared_in: Path | None = None

    @property
    def has_muscle_data(self) -> bool:
        """Whether anything but a tensile test was recorded."""
        return any(
            part is not None
            for part in (self.loops, self.force_map, self.blocked_force, self.free_contraction)
        )
