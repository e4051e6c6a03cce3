"""Declarations, designs and specimens made in memory, for the tests of model, posterior and prediction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mpam_calib.model.blueprint import Blueprint, MaterialPosterior, Options, draw_blueprint
from mpam_calib.model.readings import Readings
from mpam_calib.specimen.declaration import Braid, Csv, Fit, Geometry, Sensors, Simulation
from mpam_calib.specimen.recording import Loops, Specimen

Array = NDArray[np.float64]

GEOMETRY = Geometry(L0_mm=50.0, R0_mm=3.0, t0_mm=0.7, alpha0_deg=72.0)
BRAID = Braid(E_br_GPa=2.1, nu_s=0.33, R_br_mm=0.11, n=48)
PLAIN = Options(remainder=False, correlated_noise=False)


def loops(
    levels_kPa: tuple[float, ...] = (100.0, 150.0, 200.0),
    strokes_mm: tuple[float, ...] | float = 10.0,
    rows: tuple[int, ...] | int = 12,
    cycles: int = 1,
    dt: float = 0.1,
    ripple: float = 0.0,
) -> Loops:
    """Triangular loops without forces: ``rows`` readings on each stroke of a level, contracting first."""
    strokes = strokes_mm if isinstance(strokes_mm, tuple) else (strokes_mm,) * len(levels_kPa)
    counts = rows if isinstance(rows, tuple) else (rows,) * len(levels_kPa)
    parts: dict[str, list[Array]] = {k: [] for k in ("time", "P", "x", "level", "cycle", "branch", "stroke")}
    clock, number = 0.0, 0
    for j, (level, length, n) in enumerate(zip(levels_kPa, strokes, counts, strict=True)):
        way = (np.arange(n) + 0.5) / n * length * 1e-3
        for cycle in range(1, cycles + 1):
            for branch in (-1, 1):
                x = way if branch < 0 else way[::-1]
                time = clock + dt * np.arange(n)
                pressure = level * 1e3 * (1.0 + ripple * np.sin(time))
                for name, value in (("time", time), ("P", pressure), ("x", x)):
                    parts[name].append(value)
                for name, value in (("level", j), ("cycle", cycle), ("branch", branch), ("stroke", number)):
                    parts[name].append(np.full(n, value))
                clock, number = clock + dt * n, number + 1
        clock += 10.0
    joined = {k: np.concatenate(v) for k, v in parts.items()}
    return Loops(
        time_s=joined["time"],
        pressure_Pa=joined["P"],
        displacement_m=joined["x"],
        force_N=np.zeros(len(joined["time"])),
        level=joined["level"].astype(np.int64),
        cycle=joined["cycle"].astype(np.int64),
        branch=joined["branch"].astype(np.int64),
        stroke=joined["stroke"].astype(np.int64),
        clock=np.zeros(len(joined["time"]), dtype=np.int64),
        censored=np.zeros(len(joined["time"]), dtype=bool),
    )


def rows_of(recorded: Loops) -> Readings:
    """A reading for every row of loops, for models without history or speed."""
    n = len(recorded.time_s)
    plain = Readings.at_rest(
        recorded.pressure_Pa, recorded.displacement_m, recorded.branch.astype(np.float64)
    )
    return replace(
        plain,
        level=recorded.level,
        time=recorded.time_s,
        cycle=recorded.cycle.astype(float),
        speed=np.zeros(n),
    )


def specimen(
    simulation: dict[str, Any] | None = None,
    recorded: Loops | None = None,
    levels_kPa: tuple[float, ...] | None = None,
    **parts: Any,
) -> Specimen:
    """A specimen with MPAM1's geometry around some recordings."""
    if levels_kPa is None:
        assert recorded is not None
        count = int(recorded.level.max()) + 1
        levels = np.array([np.median(recorded.pressure_Pa[recorded.level == j]) for j in range(count)])
    else:
        levels = np.array(levels_kPa) * 1e3
    declared = {"order": 2, "law": "linear"} if simulation is None else simulation
    fields: dict[str, Any] = {
        "name": "made in memory",
        "bladder_material": "",
        "folder": Path("."),
        "geometry": GEOMETRY,
        "braid": BRAID,
        "sensors": Sensors(force_sd_N=0.2),
        "simulation": Simulation(**declared),
        "fit": Fit(),
        "csv": Csv(),
        "levels_Pa": levels,
        "loops": recorded,
        "force_map": None,
        "blocked_force": None,
        "free_contraction": None,
        "tensile": None,
        "digest": "none",
    }
    return Specimen(**{**fields, **parts})


def with_force(made: Specimen, force: Array) -> Specimen:
    """The specimen with these forces (N) in its loops."""
    assert made.loops is not None
    return replace(made, loops=replace(made.loops, force_N=force))


def take_levels(made: Specimen, kept: list[int]) -> Specimen:
    """A fold: only these levels' loops, numbered as before."""
    assert made.loops is not None
    mask = np.isin(made.loops.level, kept)
    arrays = {
        k: (v[mask] if isinstance(v, np.ndarray) and len(v) == len(mask) else v)
        for k, v in vars(made.loops).items()
    }
    return replace(made, loops=Loops(**arrays))


def blueprint(
    simulation: dict[str, Any],
    options: Options | None = None,
    recorded: Loops | None = None,
    material: MaterialPosterior | None = None,
    **parts: Any,
) -> Blueprint:
    """The blueprint of a specimen whose loops all pull with 10 N."""
    made = specimen(simulation, recorded or loops(), **parts)
    assert made.loops is not None
    return draw_blueprint(with_force(made, np.full(len(made.loops.time_s), 10.0)), options, material)
